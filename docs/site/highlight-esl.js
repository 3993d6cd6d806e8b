// Colours of programs in ESL: comments, strings, keywords, and the forms that define, fail, and make tasks.
// The classes are those of highlight.js, so that every theme of the site has its colours for them.
"use strict";

(function () {
    const forms = {
        "hljs-keyword": /^(def[a-z-]*|define-[a-z-]*|to-achieve|let\*?|if|when|unless|cond|case|loop|do[a-z-]*|progn|setf|setq|lambda|flet|labels|require|in-package|return|return-from|function|quote|and|or|not)$/,
        "hljs-type": /^(fail|retry|abort|achieve|next-bindings|with-recovery-procedures|with-cleanup-procedure|unwind-protect|handler-case|handler-bind|ignore-errors|error|is|fails|signals)$/,
        "hljs-built_in": /^(spawn|task-net|or-parallel|pursue|try-all|try-in-order|partial-order|supervise|whenever|wait-until|wait-for-[a-z]*|sleep|signal|suspend-task|resume-task|abort-task|checkpoint|checkpoint-wait|without-interrupts|with-(guardian|timeout|budget|quota|resources?|world|rights|suspension-procedures|maintained-propert(y|ies)|query-bindings))$/,
    };
    const tokens = /(;[^\n]*)|(#\|[\s\S]*?\|#)|("(?:\\[\s\S]|[^"\\])*")|(#\\(?:[a-z]+|[\s\S]))|([+-]?\d+(?:[./]\d+)?(?:e[+-]?\d+)?(?=[\s()]|$))|(#?\?[^\s()"';]*)|((?:&|:)[^\s()"';]+)|([^\s()"';`,]+)/gi;

    function classOf(match, text, index) {
        const [, line, block, string, character, number, variable, keyword, name] = match;
        if (line || block) return "hljs-comment";
        if (string || character) return "hljs-string";
        if (number) return "hljs-number";
        if (variable) return "hljs-variable";
        if (keyword) return "hljs-symbol";
        if (name && text[index - 1] === "(") {
            const word = name.toLowerCase();
            return Object.keys(forms).find((kind) => forms[kind].test(word));
        }
        return undefined;
    }

    // Colours the text of an element, and underlines the ranges `marks`: `{ start, end, kind }` each.
    function paint(code, marks = []) {
        const text = code.textContent;
        code.textContent = "";
        const bounds = marks.flatMap(({ start, end }) => [start, end]).sort((one, other) => one - other);
        let end = 0;
        function append(until, colour) {
            while (end < until) {
                const stop = Math.min(until, bounds.find((bound) => bound > end) ?? until);
                const mark = marks.find((mark) => mark.start <= end && end < mark.end);
                const classes = [colour, mark && `mark-${mark.kind}`].filter(Boolean).join(" ");
                const piece = text.slice(end, stop);
                if (classes === "") {
                    code.append(piece);
                } else {
                    const span = document.createElement("span");
                    span.className = classes;
                    span.textContent = piece;
                    code.append(span);
                }
                end = stop;
            }
        }
        for (const match of text.matchAll(tokens)) {
            append(match.index, undefined);
            append(match.index + match[0].length, classOf(match, text, match.index));
        }
        append(text.length, undefined);
        code.classList.add("hljs");
    }

    function paintCommands(code) {
        const lines = code.textContent.split("\n");
        code.textContent = "";
        lines.forEach((line, index) => {
            const typed = line.startsWith("$ ") || line.startsWith("? ");
            const part = document.createElement(typed ? "strong" : "span");
            part.textContent = line + (index + 1 < lines.length ? "\n" : "");
            code.append(part);
        });
        code.classList.add("hljs");
    }

    window.paintEsl = paint;
    document.querySelectorAll("code.language-lisp").forEach((code) => paint(code));
    document.querySelectorAll("code.language-console, code.language-repl").forEach(paintCommands);
})();
