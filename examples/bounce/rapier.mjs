// Rapier 2D, for `flipproof bounce cmd:'node rapier.mjs [set]'`.
import RAPIER from "@dimforge/rapier2d-compat";
import { BEST, RADIUS, serve, version } from "./serve.mjs";

const { RigidBodyDesc, ColliderDesc, CoefficientCombineRule } = RAPIER;
await RAPIER.init();

function flight(height, speed, restitution, gravity, dt) {
  const world = new RAPIER.World({ x: 0, y: -gravity });
  world.timestep = dt;
  if (BEST) Object.assign(world.integrationParameters, SET);
  const law = (shape) => shape.setFriction(0).setRestitution(restitution).setRestitutionCombineRule(CoefficientCombineRule.Max);
  world.createCollider(law(ColliderDesc.cuboid(50, 50).setTranslation(0, -50)));
  const body = RigidBodyDesc.dynamic().setTranslation(0, height + RADIUS).setLinvel(0, speed);
  const ball = world.createRigidBody(body.setCanSleep(false).lockRotations().setCcdEnabled(BEST));
  world.createCollider(law(ColliderDesc.ball(RADIUS)), ball);
  return [() => world.step(), () => [ball.translation().y - RADIUS, ball.linvel().y], () => world.free()];
}

const SET = { normalizedAllowedLinearError: 1e-5, normalizedPredictionDistance: 1e-4 };
const { normalizedAllowedLinearError, normalizedPredictionDistance } = Object.assign(new RAPIER.IntegrationParameters(), BEST ? SET : {});
serve({ version: version("@dimforge/rapier2d-compat"), normalizedAllowedLinearError, normalizedPredictionDistance, ccd: BEST }, flight);
