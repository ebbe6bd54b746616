// Jolt Physics, for `flipproof bounce cmd:'node jolt.mjs [set]'`. Of the two restitutions it takes the larger.
import init from "jolt-physics";
import { BEST, serve, version } from "./serve.mjs";

const RADIUS = 0.1;
const Jolt = await init();
const settings = new Jolt.JoltSettings();
const pairs = new Jolt.ObjectLayerPairFilterTable(1);
pairs.EnableCollision(0, 0);
const broad = new Jolt.BroadPhaseLayerInterfaceTable(1, 1);
broad.MapObjectToBroadPhaseLayer(0, new Jolt.BroadPhaseLayer(0));
settings.mObjectLayerPairFilter = pairs;
settings.mBroadPhaseLayerInterface = broad;
settings.mObjectVsBroadPhaseLayerFilter = new Jolt.ObjectVsBroadPhaseLayerFilterTable(broad, 1, pairs, 1);
const jolt = new Jolt.JoltInterface(settings);
const system = jolt.GetPhysicsSystem();
const bodies = system.GetBodyInterface();
const law = system.GetPhysicsSettings();
if (BEST) Object.assign(law, { mMinVelocityForRestitution: 0, mSpeculativeContactDistance: 1e-5, mPenetrationSlop: 1e-5 });
system.SetPhysicsSettings(law);

function body(shape, y, kind, speed, restitution) {
  const made = new Jolt.BodyCreationSettings(shape, new Jolt.RVec3(0, y, 0), new Jolt.Quat(0, 0, 0, 1), kind, 0);
  Object.assign(made, { mRestitution: restitution, mFriction: 0, mLinearDamping: 0, mAllowSleeping: false });
  made.mLinearVelocity = new Jolt.Vec3(0, speed, 0);
  if (BEST) made.mMotionQuality = Jolt.EMotionQuality_LinearCast;
  return bodies.CreateBody(made);
}

function flight(height, speed, restitution, gravity, dt) {
  system.SetGravity(new Jolt.Vec3(0, -gravity, 0));
  const floor = body(new Jolt.BoxShape(new Jolt.Vec3(50, 50, 50)), -50, Jolt.EMotionType_Static, 0, 0);
  const ball = body(new Jolt.SphereShape(RADIUS), height + RADIUS, Jolt.EMotionType_Dynamic, speed, restitution);
  const all = [floor, ball].map((each) => each.GetID());
  for (const each of all) bodies.AddBody(each, Jolt.EActivation_Activate);
  const free = () => all.forEach((each) => (bodies.RemoveBody(each), bodies.DestroyBody(each)));
  return [() => jolt.Step(dt, 1), () => [ball.GetPosition().GetY() - RADIUS, ball.GetLinearVelocity().GetY()], free];
}

const { mMinVelocityForRestitution, mSpeculativeContactDistance, mPenetrationSlop } = law;
const shown = { mMinVelocityForRestitution, mSpeculativeContactDistance, mPenetrationSlop };
serve({ version: version("jolt-physics"), ...shown, motion: BEST ? "LinearCast" : "Discrete" }, flight);
