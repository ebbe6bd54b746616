// What a kept program says to `flipproof bounce cmd:'node ENGINE.mjs'`: its settings, then an answer a line of input.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";

export const BEST = process.argv[2] === "set"; // settings for bouncing instead of those it comes with
export const RADIUS = 0.1; // of the ball [m]

export function version(name) {
  return JSON.parse(readFileSync(new URL(`node_modules/${name}/package.json`, import.meta.url))).version;
}

// flight(height, speed, restitution, gravity, dt) returns [step, state, free]; state() is [y, v]; free() is not needed
export async function serve(settings, flight) {
  for (const name in settings) console.log(`# ${name} = ${settings[name]}`);
  for await (const line of createInterface({ input: process.stdin })) {
    const [height, speed, restitution, gravity, dt, duration] = line.split(" ").map(Number);
    const [step, state, free] = flight(height, speed, restitution, gravity, dt);
    const rows = ["t,y,v"];
    for (let k = 0; k <= Math.round(duration / dt); k++) {
      if (k) step();
      rows.push([k * dt, ...state()].join());
    }
    free?.();
    console.log(rows.join("\n") + "\n");
  }
}
