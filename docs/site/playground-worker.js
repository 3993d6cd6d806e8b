// Runs programs beside the page: the compiler and the machine as a module of WebAssembly. A run goes in steps of a
// few milliseconds, between which messages of the page are read.
"use strict";

const MOST_TICKS = 4e6;
const STEP_MILLISECONDS = 40;

let wasm;
let running = 0;

function call(name, text, ...numbers) {
    if (text !== undefined) {
        const bytes = new TextEncoder().encode(text);
        const at = wasm.reserve(bytes.length);
        new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
    }
    const length = wasm[name](...numbers);
    return new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, wasm.buffer(), length));
}

async function run(id) {
    let ticks = 20000;
    while (running === id) {
        const begun = performance.now();
        const step = JSON.parse(call("step", undefined, ticks));
        postMessage({ kind: "step", id, ...step });
        if (step.ended !== null) {
            running = 0;
            postMessage({ kind: "ended", id, ended: step.ended, timeline: call("timeline") });
            return;
        }
        const taken = performance.now() - begun;
        ticks = Math.round(Math.min(MOST_TICKS, Math.max(1000, ticks * Math.min(2, STEP_MILLISECONDS / (taken + 1)))));
        await new Promise((next) => setTimeout(next));
    }
}

const answers = {
    check: ({ id, text }) => postMessage({ kind: "checked", id, ...JSON.parse(call("check", text)) }),
    format: ({ id, text }) => postMessage({ kind: "formatted", id, text: call("format", text) }),
    run: ({ id, text, seed, traced }) => {
        running = 0;
        const begun = JSON.parse(call("begin", text, seed, traced ? 1 : 0));
        postMessage({ kind: "begun", id, ...begun });
        if (begun.runs) {
            running = id;
            run(id);
        }
    },
    stop: () => wasm.stop(),
};

const loaded = WebAssembly.instantiateStreaming
    ? fetch("esl-playground.wasm").then(async (response) => {
        if (!response.ok) throw new Error(`esl-playground.wasm: ${response.status} ${response.statusText}`);
        return WebAssembly.instantiate(await response.arrayBuffer());
    })
    : Promise.reject(new Error("this browser has no WebAssembly"));

loaded.then(
    ({ instance }) => {
        wasm = instance.exports;
        postMessage({ kind: "ready", examples: JSON.parse(call("examples")) });
        onmessage = ({ data }) => {
            try {
                answers[data.kind](data);
            } catch (error) {
                postMessage({ kind: "broken", id: data.id, message: String(error) });
            }
        };
    },
    (error) => postMessage({ kind: "missing", message: String(error) }),
);
