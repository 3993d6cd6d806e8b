// The playground: an editor, buttons, what a program prints, its diagnostics and its timeline. Programs run in a
// worker, so that the page answers whatever they do; one that does not even stop is ended with its worker.
"use strict";

(function () {
    const root = document.getElementById("esl-playground");
    const folder = new URL(".", document.currentScript.src);
    const FORCE_AFTER = 3000;

    root.innerHTML = `
        <div class="bar">
            <select id="pg-examples" aria-label="Examples"></select>
            <button id="pg-run" title="Ctrl-Enter" disabled>Run</button>
            <button id="pg-stop" disabled>Stop</button>
            <button id="pg-format" disabled>Indent</button>
            <label><input id="pg-traced" type="checkbox"> trace failures</label>
            <label>seed <input id="pg-seed" type="number" min="0" max="4294967295" value="0"></label>
            <button id="pg-share" title="A link with the program in it">Link</button>
        </div>
        <div class="editor"><div class="under" aria-hidden="true"><div class="text"></div></div><textarea id="pg-text" wrap="off" spellcheck="false"
            autocapitalize="off" autocomplete="off" aria-label="Program"></textarea></div>
        <ul id="pg-diagnostics"></ul>
        <p id="pg-status" role="status">Loading …</p>
        <pre id="pg-output" aria-label="Output" hidden></pre>
        <div id="pg-timeline" hidden></div>`;
    const part = (name) => document.getElementById(`pg-${name}`);
    const [text, output, status, timeline] = ["text", "output", "status", "timeline"].map(part);
    const shown = root.querySelector(".editor .text");

    let worker;
    let latest = 0;
    let awaited = { check: 0, run: 0, format: 0 };
    let force;
    let marks = [];
    let examples = [];

    function start() {
        worker = new Worker(new URL("playground-worker.js", folder));
        worker.onmessage = ({ data }) => heard[data.kind](data);
        worker.onerror = (event) => say(`The worker failed: ${event.message}`, true);
    }

    function ask(kind, more) {
        awaited[kind] = ++latest;
        worker.postMessage({ kind, id: latest, text: text.value, ...more });
    }

    function say(words, isBad) {
        status.textContent = words;
        status.classList.toggle("bad", Boolean(isBad));
    }

    function setRunning(runs) {
        part("run").disabled = runs;
        part("format").disabled = runs;
        part("stop").disabled = !runs;
        if (!runs) clearTimeout(force);
    }

    // The text under the text: colours, and lines under what diagnostics are about.
    function paint() {
        shown.textContent = `${text.value}\n`;
        window.paintEsl(shown, marks);
        scroll();
    }

    function scroll() {
        const under = shown.parentElement;
        under.scrollTop = text.scrollTop;
        under.scrollLeft = text.scrollLeft;
    }

    function show(diagnostics) {
        marks = diagnostics.map(({ start, end, severity }) => ({ start, end: Math.max(end, start + 1), kind: severity }));
        part("diagnostics").replaceChildren(...diagnostics.map((found) => {
            const item = document.createElement("li");
            const place = document.createElement("button");
            place.textContent = `${found.line}:${found.column}`;
            place.onclick = () => {
                text.focus();
                text.setSelectionRange(found.start, found.end);
            };
            item.className = `pg-${found.severity}`;
            const words = [`${found.severity}: ${found.message}`, found.label, found.help && `help: ${found.help}`];
            item.append(place, ` ${words.filter(Boolean).join("; ")}`);
            return item;
        }));
        paint();
    }

    function print(words, isError) {
        if (words === "") return;
        let last = output.lastChild;
        const kind = isError ? "pg-error" : "plain";
        if (last === null || last.className !== kind) {
            last = document.createElement("span");
            last.className = kind;
            output.append(last);
        }
        last.append(words);
        output.hidden = false;
        output.scrollTop = output.scrollHeight;
    }

    let picture;
    function draw(svg) {
        if (picture) URL.revokeObjectURL(picture);
        timeline.replaceChildren();
        timeline.hidden = svg === "";
        if (svg === "") return;
        picture = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
        const image = document.createElement("img");
        image.src = picture;
        image.alt = "Timeline of the tasks";
        const link = document.createElement("a");
        link.href = picture;
        link.target = "_blank";
        link.title = "Open the timeline by itself";
        link.append(image);
        timeline.append(link);
    }

    const heard = {
        ready: (data) => {
            setRunning(false);
            say("Ready.");
            if (examples.length === 0) {
                examples = data.examples;
                part("examples").append(...examples.map(({ title }) => new Option(title)));
                if (text.value === "") choose(0);
            }
            ask("check");
        },
        missing: ({ message }) => say(`The playground could not be loaded: ${message}. It needs a web server, `
            + "such as python3 -m http.server; browsers load no such files from a disk.", true),
        broken: ({ message }) => {
            say(`The machine has broken down, which no program should bring about: ${message}`, true);
            restart();
        },
        checked: ({ id, diagnostics }) => {
            if (id === awaited.check) show(diagnostics);
        },
        formatted: ({ id, text: formatted }) => {
            if (id === awaited.format && formatted !== text.value) {
                replace(formatted);
            }
        },
        begun: ({ id, diagnostics, printed, runs, error }) => {
            if (id !== awaited.run) return;
            show(diagnostics);
            print(printed, false);
            if (runs) return say("Running …");
            setRunning(false);
            say(error || "It does not compile: see above.", true);
        },
        step: ({ id, pieces, ticks }) => {
            if (id !== awaited.run) return;
            for (const { text: words, error } of pieces) print(words, error);
            say(`Running … ${ticks.toLocaleString("en")} ticks`);
        },
        ended: ({ id, ended, timeline: svg }) => {
            if (id !== awaited.run) return;
            setRunning(false);
            say(ended, !/^(Ended\.|Stopped)/.test(ended));
            draw(svg);
        },
    };

    function run() {
        if (part("run").disabled) return;
        output.replaceChildren();
        output.hidden = true;
        draw("");
        setRunning(true);
        say("Compiling …");
        ask("run", { seed: Number(part("seed").value) >>> 0, traced: part("traced").checked });
    }

    function stop() {
        say("Stopping …");
        worker.postMessage({ kind: "stop" });
        clearTimeout(force);
        force = setTimeout(() => {
            restart();
            say("Stopped by force: the program was being compiled, or its cleanups took too long.", true);
        }, FORCE_AFTER);
    }

    function restart() {
        worker.terminate();
        awaited.run = 0;
        setRunning(false);
        start();
    }

    // By the browser's own editing, so that it can be undone.
    function replace(words) {
        const at = text.selectionStart;
        text.focus();
        text.select();
        if (!document.execCommand("insertText", false, words)) text.value = words;
        text.setSelectionRange(at, at);
        edited();
    }

    function choose(index) {
        text.value = examples[index].text;
        text.scrollTop = 0;
        marks = [];
        edited();
    }

    let pause;
    function edited() {
        // The places of marks hold for the text that was checked.
        marks = [];
        paint();
        clearTimeout(pause);
        pause = setTimeout(() => part("stop").disabled && ask("check"), 400);
    }

    text.addEventListener("input", edited);
    text.addEventListener("scroll", scroll);
    part("run").onclick = run;
    part("stop").onclick = stop;
    part("format").onclick = () => ask("format");
    part("examples").onchange = () => choose(part("examples").selectedIndex);
    part("share").onclick = () => {
        const bytes = new TextEncoder().encode(text.value);
        location.hash = `program=${btoa(String.fromCharCode(...bytes)).replace(/\+/g, "-").replace(/\//g, "_")}`;
        const copied = navigator.clipboard ? navigator.clipboard.writeText(location.href) : Promise.reject();
        copied.then(() => say("The link is in the clipboard."), () => say("The link is in the address bar."));
    };
    // The site's own keys are not for those who type.
    root.addEventListener("keydown", (event) => {
        event.stopPropagation();
        if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
            event.preventDefault();
            run();
        }
    });

    const linked = /^#program=([\w=-]+)$/.exec(location.hash);
    if (linked) {
        try {
            const bytes = atob(linked[1].replace(/-/g, "+").replace(/_/g, "/"));
            text.value = new TextDecoder().decode(Uint8Array.from(bytes, (byte) => byte.charCodeAt(0)));
        } catch {
            say("The link does not hold a whole program.", true);
        }
    }
    // The colours are in a script that comes after this one.
    addEventListener("DOMContentLoaded", () => {
        paint();
        start();
    });
})();
