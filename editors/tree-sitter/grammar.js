/**
 * ESL, the Execution Support Language.
 *
 * The tokens are those of the compiler's reader (`compiler/src/reader/lexer.rs`). What a list means depends on its
 * operator, and a macro may be called anything, so that is left to the queries.
 */

/// <reference types="tree-sitter-cli/dsl" />
// @ts-check

// A character that can be part of a name without an escape. `#` can be, too, but not at the beginning.
const FIRST =
  /[^#()"';`,|\\\s\u0000-\u0020\u007F-\u00A0\u1680\u2000-\u200B\u200E\u200F\u2028-\u202F\u205F-\u2060\u2066-\u2069\u3000\uFEFF]/;
const CONSTITUENT = choice("#", FIRST);
const ESCAPED = choice(/\\(.|\n)/, seq("|", repeat(choice(/[^|\\]/, /\\(.|\n)/)), "|"));
const REST = repeat(choice(CONSTITUENT, ESCAPED));
const DIGITS = repeat(/[0-9]/);
const SIGN = optional(/[-+]/);
const EXPONENT = /[eEsSfFdDlL][-+]?[0-9]+/;

// Of several tokens that match, the longest one counts, and of those the one that comes first here: `1` is a
// number, `1+` a symbol.
module.exports = grammar({
  name: "esl",

  // They nest.
  externals: ($) => [$.block_comment],

  extras: ($) => [/[ \t\n\r\f\uFEFF]/, $.comment, $.block_comment],

  rules: {
    source: ($) => seq(optional($.interpreter), repeat($._datum)),

    interpreter: (_) => token(/#![^\n]*/),

    _datum: ($) =>
      choice(
        $.list,
        $.vector,
        $.quote,
        $.backquote,
        $.unquote,
        $.unquote_splicing,
        $.function,
        $.read_eval,
        $.conditional,
        $.array,
        $.label,
        $.reference,
        $.structure,
        $.pathname,
        $.complex,
        $.bit_vector,
        $.string,
        $.character,
        $.number,
        $.keyword,
        $.uninterned,
        $.logical_variable,
        $.symbol,
      ),

    list: ($) => seq("(", repeat(choice($._datum, $.dot)), ")"),
    vector: ($) => seq(token(seq("#", DIGITS, "(")), repeat($._datum), ")"),
    dot: (_) => ".",

    quote: ($) => seq("'", $._datum),
    backquote: ($) => seq("`", $._datum),
    unquote: ($) => seq(",", $._datum),
    unquote_splicing: ($) => seq(choice(",@", ",."), $._datum),
    function: ($) => seq("#'", $._datum),
    read_eval: ($) => seq("#.", $._datum),
    conditional: ($) => seq(choice("#+", "#-"), field("feature", $._datum), $._datum),
    array: ($) => seq(token(seq("#", DIGITS, /[aA]/)), $._datum),
    label: ($) => seq(token(/#[0-9]+=/), $._datum),
    reference: (_) => token(/#[0-9]+#/),
    structure: ($) => seq(token(/#[sS]/), $._datum),
    pathname: ($) => seq(token(/#[pP]/), $._datum),
    complex: ($) => seq(token(/#[cC]/), $._datum),
    bit_vector: (_) => token(seq("#", DIGITS, "*", repeat(CONSTITUENT))),

    string: (_) => token(seq('"', repeat(choice(/[^"\\]/, /\\(.|\n)/)), '"')),

    character: (_) => token(seq("#\\", /.|\n/, repeat(CONSTITUENT))),

    number: (_) =>
      choice(
        token(seq(SIGN, /[0-9]+/, optional("."))),
        token(seq(SIGN, /[0-9]+\/[0-9]+/)),
        token(seq(SIGN, /[0-9]*\.[0-9]+/, optional(EXPONENT))),
        token(seq(SIGN, /[0-9]+/, optional(/\.[0-9]*/), EXPONENT)),
        token(seq("#", choice(/[xXbBoO]/, seq(DIGITS, /[rR]/)), repeat(CONSTITUENT))),
      ),

    keyword: (_) => token(seq(":", REST)),
    uninterned: (_) => token(seq("#:", REST)),
    logical_variable: (_) => token(seq(choice("?", "#?"), REST)),
    symbol: (_) => token(seq(choice(FIRST, ESCAPED), REST)),

    comment: (_) => token(/;[^\n]*/),
  },
});
