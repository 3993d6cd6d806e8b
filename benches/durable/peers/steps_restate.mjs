// The same run of steps as a service of Restate: `steps_restate.mjs FOLDER PORT` serves; the server calls it.

import fs from "node:fs";
import * as restate from "@restatedev/restate-sdk";

const [folder, port] = process.argv.slice(2);
const lines = fs.openSync(`${folder}/lines`, "a");

const steps = restate.service({
  name: "steps",
  handlers: {
    run: async (context, count) => {
      for (let number = 0; number < count; number++) {
        await context.run("add line", () => { fs.writeSync(lines, `${number}\n`); });
      }
    },
  },
});

restate.serve({ services: [steps], port: Number(port) });
