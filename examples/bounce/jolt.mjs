// Jolt Physics, for `flipproof bounce cmd:'node jolt.mjs [set]'`. Of the two restitutions it takes the larger.
import init from "jolt-physics";
import { BEST, RADIUS, serve, version } from "./serve.mjs";

const Jolt = await init();
const setup = new Jolt.JoltSettings();
setup.mBroadPhaseLayerInterface = new Jolt.BroadPhaseLayerInterfaceTable(1, 1);
setup.mObjectLayerPairFilter = new Jolt.ObjectLayerPairFilter(); // both filters let all collide
setup.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilter();
const jolt = new Jolt.JoltInterface(setup);
const system = jolt.GetPhysicsSystem(), bodies = system.GetBodyInterface(), settings = system.GetPhysicsSettings();
const SET = { mMinVelocityForRestitution: 0, mSpeculativeContactDistance: 1e-5, mPenetrationSlop: 1e-5 };
if (BEST) system.SetPhysicsSettings(Object.assign(settings, SET));

function add(shape, y, kind, more) {
  const body = new Jolt.BodyCreationSettings(shape, new Jolt.RVec3(0, y, 0), new Jolt.Quat(0, 0, 0, 1), kind, 0);
  if (BEST) body.mMotionQuality = Jolt.EMotionQuality_LinearCast;
  Object.assign(body, { mFriction: 0, mLinearDamping: 0, mAllowSleeping: false, ...more });
  return bodies.CreateAndAddBody(body, Jolt.EActivation_Activate);
}

add(new Jolt.BoxShape(new Jolt.Vec3(50, 50, 50)), -50, Jolt.EMotionType_Static, { mRestitution: 0 });

function flight(height, speed, mRestitution, gravity, dt) {
  system.SetGravity(new Jolt.Vec3(0, -gravity, 0));
  const more = { mRestitution, mLinearVelocity: new Jolt.Vec3(0, speed, 0) };
  const ball = add(new Jolt.SphereShape(RADIUS), height + RADIUS, Jolt.EMotionType_Dynamic, more);
  const state = () => [bodies.GetPosition(ball).GetY() - RADIUS, bodies.GetLinearVelocity(ball).GetY()];
  return [() => jolt.Step(dt, 1), state, () => (bodies.RemoveBody(ball), bodies.DestroyBody(ball))];
}

for (const name in SET) SET[name] = settings[name]; // read back
serve({ version: version("jolt-physics"), ...SET, LinearCast: BEST }, flight);
