//! Tokens: the smallest pieces of source text, found by a generated lexer.
//!
//! Guarantees: the tokens of a text do not overlap, only blanks and comments lie between them, and finding
//! the next one takes no native recursion and time in proportion to its length. A token knows only its kind:
//! its meaning is computed from its text, and only if `#+` or `#-` does not skip it. Not here: the meaning of
//! tokens (`number`, `name`, `character`), their nesting (`scan`, the grammar).

use logos::{FilterResult, Lexer, Logos};

/// The kind of a token.
///
/// A *constituent* is a character that can be part of a name without an escape. Blanks other than the usual
/// ones, control characters and marks that reverse the direction of text are not constituents, because they
/// are invisible.
#[derive(Logos, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[logos(skip r"[ \t\n\r\f]+")]
#[logos(skip(r";[^\n]*", allow_greedy = true))]
#[logos(error = LexError)]
#[logos(subpattern stray = r#"[[\p{White_Space}\p{Cc}\u{200B}\u{200E}\u{200F}\u{202A}-\u{202E}\u{2060}\u{2066}-\u{2069}\u{FEFF}]--[ \t\n\r\f]]"#)]
#[logos(subpattern first = r##"[^#()"';`,|\\\p{White_Space}\p{Cc}\u{200B}\u{200E}\u{200F}\u{202A}-\u{202E}\u{2060}\u{2066}-\u{2069}\u{FEFF}]"##)]
#[logos(subpattern constituent = r##"(#|(?&first))"##)]
#[logos(subpattern escaped = r"(\\(?s:.)|\|([^|\\]|\\(?s:.))*\|)")]
pub enum Token {
    /// `(`
    #[token("(")]
    Open,
    /// `)`
    #[token(")")]
    Close,
    /// `.` by itself
    #[token(".", priority = 100)]
    Dot,
    /// `'`
    #[token("'")]
    Quote,
    /// A backquote
    #[token("`")]
    Backquote,
    /// `,`
    #[token(",")]
    Comma,
    /// `,@` or `,.`
    #[token(",@")]
    #[token(",.")]
    CommaAt,
    /// `#'`
    #[token("#'")]
    Function,
    /// A number, or a name without escapes.
    #[regex(r"(?&first)(?&constituent)*", priority = 1)]
    Atom,
    /// A name with `\` or `|…|` in it.
    #[regex(r"((?&first)(?&constituent)*)?(?&escaped)((?&constituent)|(?&escaped))*", priority = 1)]
    Escaped,
    /// `"…"`
    #[token("\"", string)]
    String,
    /// `#\x` or `#\Name`
    #[regex(r"#\\(?s:.)(?&constituent)*", priority = 100)]
    Character,
    /// `#xFF`, `#b101`, `#o17`, `#36rZZ`
    #[regex(r"#[xXbBoO](?&constituent)*", priority = 100)]
    #[regex(r"#[0-9]*[rR](?&constituent)*", priority = 100)]
    Radix,
    /// `#:name`
    #[regex(r"#:((?&constituent)|(?&escaped))*", priority = 100)]
    Uninterned,
    /// `#?variable`
    #[regex(r"#\?((?&constituent)|(?&escaped))*", priority = 100)]
    LogicalVariable,
    /// `#(` or `#n(`
    #[regex(r"#[0-9]*\(", priority = 100)]
    Vector,
    /// `#nA`
    #[regex(r"#[0-9]*[aA]", priority = 100)]
    Array,
    /// `#n=`
    #[regex(r"#[0-9]+=", priority = 100)]
    Label,
    /// `#n#`
    #[regex(r"#[0-9]+#", priority = 100)]
    Reference,
    /// `#+`
    #[token("#+", priority = 100)]
    FeaturePresent,
    /// `#-`
    #[token("#-", priority = 100)]
    FeatureAbsent,
    /// `#.`, before a form that is evaluated when it has been read.
    #[token("#.", priority = 100)]
    ReadEval,
    /// `#S`, before the list of a structure.
    #[regex(r"#[sS]", priority = 100)]
    Structure,
    /// `#P`, before the string of a pathname.
    #[regex(r"#[pP]", priority = 100)]
    Pathname,
    /// `#C`, before the list of the two parts of a complex number.
    #[regex(r"#[cC]", priority = 100)]
    Complex,
    /// `#*0101` or `#n*0101`, a bit vector.
    #[regex(r"#[0-9]*\*(?&constituent)*", priority = 100)]
    BitVector,
    /// `#<…>`, as objects are printed that cannot be read.
    #[regex(r"#<[^>\n]*>?", allow_greedy = true, priority = 100)]
    Unreadable,
    /// `#` with anything else after it.
    #[regex(r"#[0-9]*", priority = 99)]
    #[regex(r"#[0-9]*(?&constituent)", priority = 2)]
    UnknownDispatch,
    /// Characters that are allowed only in strings, comments and bars.
    #[regex(r"(?&stray)+", priority = 1)]
    Stray,
    /// `#| … |#`, which is skipped: never the kind of a returned token.
    #[token("#|", block_comment, priority = 200)]
    BlockComment,
    /// A name without an end: never the kind of a returned token.
    #[regex(
        r"((#:|#\?|(?&first)|(?&escaped))((?&constituent)|(?&escaped))*)?\|",
        unclosed_bar,
        priority = 50
    )]
    #[regex(
        r"((#:|#\?|(?&first)|(?&escaped))((?&constituent)|(?&escaped))*)?\\",
        unfinished_escape,
        priority = 50
    )]
    #[token("#\\", unfinished_escape, priority = 200)]
    Unfinished,
}

/// A token and its place, in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lexeme {
    pub(super) token: Token,
    pub(super) start: u32,
    pub(super) end: u32,
}

/// Why there is no token: the text ends too early.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LexError {
    /// The text ends within a string.
    UnclosedString,
    /// The text ends within `#| … |#`.
    UnclosedComment,
    /// The text ends within `| … |`.
    UnclosedBar,
    /// The text ends after `\` or `#\`.
    UnfinishedEscape,
    /// No rule matches, which the rules above exclude.
    #[default]
    Unknown,
}

/// Finds the end of a string. A backslash takes the next character with it. Quote and backslash are ASCII, so
/// looking at bytes is enough.
fn string(lexer: &mut Lexer<'_, Token>) -> Result<(), LexError> {
    let rest = lexer.remainder().as_bytes();
    let mut at = 0;
    while let Some(found) = rest.get(at..).and_then(|rest| rest.iter().position(|&b| b == b'"' || b == b'\\'))
    {
        at += found;
        if rest[at] == b'"' {
            lexer.bump(at + 1);
            return Ok(());
        }
        at += 2;
    }
    lexer.bump(rest.len());
    Err(LexError::UnclosedString)
}

/// Finds the end of a block comment. Block comments nest.
fn block_comment(lexer: &mut Lexer<'_, Token>) -> FilterResult<(), LexError> {
    let rest = lexer.remainder().as_bytes();
    let mut depth = 1;
    let mut at = 0;
    while let Some(found) = rest[at..].iter().position(|&b| b == b'|' || b == b'#') {
        at += found;
        match (rest[at], rest.get(at + 1)) {
            (b'|', Some(b'#')) => {
                depth -= 1;
                at += 2;
                if depth == 0 {
                    lexer.bump(at);
                    return FilterResult::Skip;
                }
            }
            (b'#', Some(b'|')) => {
                depth += 1;
                at += 2;
            }
            _ => at += 1,
        }
    }
    lexer.bump(rest.len());
    FilterResult::Error(LexError::UnclosedComment)
}

/// Takes the rest of the text, when the rule for whole names has found no closing bar.
fn unclosed_bar(lexer: &mut Lexer<'_, Token>) -> Result<(), LexError> {
    lexer.bump(lexer.remainder().len());
    Err(LexError::UnclosedBar)
}

fn unfinished_escape(_: &mut Lexer<'_, Token>) -> Result<(), LexError> {
    Err(LexError::UnfinishedEscape)
}

/// Returns the tokens of a text with their places in bytes, from byte `start` on. Behind an error, tokens go
/// on where its own text ends.
pub fn tokens(
    text: &str,
    start: usize,
) -> impl Iterator<Item = (Result<Token, LexError>, std::ops::Range<usize>)> {
    let lexer = Token::lexer(&text[start..]).spanned();
    lexer.map(move |(token, place)| (token, place.start + start..place.end + start))
}
