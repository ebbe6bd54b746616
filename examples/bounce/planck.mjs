// Planck, for `flipproof bounce cmd:'node planck.mjs [set]'`. Of the two restitutions it takes the larger.
import { Box, Circle, Settings, Vec2, World } from "planck";
import { BEST, RADIUS, serve, version } from "./serve.mjs";

if (BEST) Object.assign(Settings, { velocityThreshold: 0, linearSlop: 1e-5 });

function flight(height, speed, restitution, gravity, dt) {
  const world = new World({ gravity: new Vec2(0, -gravity), allowSleep: false });
  const floor = world.createBody();
  floor.createFixture(new Box(50, 50, new Vec2(0, -50), 0), { friction: 0, restitution: 0 });
  const ball = world.createDynamicBody({
    position: new Vec2(0, height + RADIUS), linearVelocity: new Vec2(0, speed), fixedRotation: true, bullet: BEST,
  });
  ball.createFixture(new Circle(RADIUS), { density: 1, friction: 0, restitution });
  return [() => world.step(dt), () => [ball.getPosition().y - RADIUS, ball.getLinearVelocity().y]];
}

const { velocityThreshold, linearSlop } = Settings;
serve({ version: version("planck"), velocityThreshold, linearSlop, bullet: BEST }, flight);
