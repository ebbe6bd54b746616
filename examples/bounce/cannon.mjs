// cannon-es, for `flipproof bounce cmd:'node cannon.mjs [set]'`.
import * as CANNON from "cannon-es";
import { BEST, RADIUS, serve, version } from "./serve.mjs";

const [contactEquationStiffness, contactEquationRelaxation] = BEST ? [1e12, 1e3] : [1e7, 3];

function flight(height, speed, restitution, gravity, dt) {
  const world = new CANNON.World({ gravity: new CANNON.Vec3(0, 0, -gravity), allowSleep: false });
  const law = { friction: 0, restitution, contactEquationStiffness, contactEquationRelaxation };
  world.defaultContactMaterial = new CANNON.ContactMaterial(world.defaultMaterial, world.defaultMaterial, law);
  world.addBody(new CANNON.Body({ shape: new CANNON.Plane() }));
  const ball = new CANNON.Body({
    mass: 1, shape: new CANNON.Sphere(RADIUS), linearDamping: 0, fixedRotation: true,
    position: new CANNON.Vec3(0, 0, height + RADIUS), velocity: new CANNON.Vec3(0, 0, speed),
  });
  world.addBody(ball);
  return [() => world.step(dt), () => [ball.position.z - RADIUS, ball.velocity.z]];
}

serve({ version: version("cannon-es"), contactEquationStiffness, contactEquationRelaxation }, flight);
