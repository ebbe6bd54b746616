// Matter.js, for `flipproof bounce cmd:'node matter.mjs [set]'`: 100 px are 1 m, times in ms, y downward.
import Matter from "matter-js";
import { BEST, serve, version } from "./serve.mjs";

const { Bodies, Body, Composite, Engine } = Matter;
const [SCALE, RADIUS] = [100, 10];
if (BEST) Matter.Resolver._restingThresh = 1e-3; // private: px in a sixtieth of a second, below which nothing rebounds

function flight(height, speed, restitution, gravity, dt) {
  const engine = Engine.create({ gravity: { x: 0, y: 1, scale: (gravity * SCALE) / 1e6 } });
  const law = { restitution, friction: 0, frictionStatic: 0, frictionAir: 0 };
  const ball = Bodies.circle(0, -height * SCALE - RADIUS, RADIUS, { ...law, inertia: Infinity });
  Composite.add(engine.world, [Bodies.rectangle(0, 500, 4000, 1000, { ...law, isStatic: true }), ball]);
  Body.update(ball, 0.0); // its bounds
  ball.deltaTime = dt * 1e3;
  Body.setVelocity(ball, { x: 0, y: (-speed * SCALE * Body._baseDelta) / 1e3 });
  const rate = () => (-Body.getVelocity(ball).y * 1e3) / Body._baseDelta / SCALE;
  return [() => Engine.update(engine, dt * 1e3), () => [(-ball.position.y - RADIUS) / SCALE, rate()]];
}

serve({ version: version("matter-js"), "Resolver._restingThresh": Matter.Resolver._restingThresh, "pixels in a metre": SCALE }, flight);
