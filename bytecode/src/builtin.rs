//! The builtin table: every function that is written in Rust, declared once, with its lambda list and what it does.
//!
//! The compiler takes names and arities from here, the virtual machine implements each row, `help` and the reference
//! print it. A row is: home package (`cl`, `esl`, or `internal` for the library's own use), name, lambda list, and for
//! a builtin that stops at a limit of work the ESL function that takes over from it.
//!
//! Builtins take required, optional and rest arguments only; functions with keyword arguments are written in ESL.

use crate::compile::Arity;
use crate::symbol::{CL_PACKAGE, ESL_PACKAGE};

/// Who a builtin's name is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// A name of the package `COMMON-LISP`.
    Cl,
    /// An external name of the package `ESL`.
    Esl,
    /// An internal name of the package `ESL`, for the library.
    Internal,
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct BuiltinInfo {
    /// The builtin.
    pub builtin: Builtin,
    /// Who its name is for.
    pub visibility: Visibility,
    /// Its name.
    pub name: &'static str,
    /// Its lambda list as it is shown to people, without parentheses.
    pub lambda_list: &'static str,
    /// The arguments that it takes.
    pub arity: Arity,
    /// The ESL function, internal to the package `ESL`, that takes over when the work is above a builtin's limit.
    pub slowly: Option<&'static str>,
    /// What it does.
    pub doc: &'static [&'static str],
}

impl BuiltinInfo {
    /// Name of the home package.
    pub fn package(&self) -> &'static str {
        match self.visibility {
            Visibility::Cl => CL_PACKAGE,
            Visibility::Esl | Visibility::Internal => ESL_PACKAGE,
        }
    }
}

/// Counts the parameters of a lambda list at compile time.
const fn arity_of(lambda_list: &str) -> Arity {
    let bytes = lambda_list.as_bytes();
    let mut at = 0;
    let mut min = 0;
    let mut optional = 0;
    // 0: required, 1: after &optional, 2: after &rest.
    let mut state = 0;
    while at < bytes.len() {
        let start = at;
        while at < bytes.len() && bytes[at] != b' ' {
            at += 1;
        }
        if at > start {
            if bytes[start] == b'&' {
                state = if bytes[start + 1] == b'o' { 1 } else { 2 };
            } else if state == 0 {
                min += 1;
            } else if state == 1 {
                optional += 1;
            }
        }
        at += 1;
    }
    Arity { min, max: if state == 2 { None } else { Some(min + optional) } }
}

macro_rules! visibility {
    (cl) => {
        Visibility::Cl
    };
    (esl) => {
        Visibility::Esl
    };
    (internal) => {
        Visibility::Internal
    };
}

macro_rules! slowly {
    () => {
        None
    };
    ($name:literal) => {
        Some($name)
    };
}

macro_rules! define_builtins {
    ($( $(#[doc = $doc:literal])* $id:ident = $visibility:ident $name:literal ($lambda_list:literal) $(slowly $slowly:literal)? ; )*) => {
        /// A function that is written in Rust.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum Builtin {
            $( $(#[doc = $doc])* $id, )*
        }

        /// The table as data; a builtin's number is its position.
        pub const BUILTINS: &[BuiltinInfo] = &[
            $( BuiltinInfo {
                builtin: Builtin::$id,
                visibility: visibility!($visibility),
                name: $name,
                lambda_list: $lambda_list,
                arity: arity_of($lambda_list),
                slowly: slowly!($($slowly)?),
                doc: &[$( $doc ),*],
            }, )*
        ];
    };
}

impl Builtin {
    /// The builtin with this number, unless there is none.
    pub fn from_number(number: u32) -> Option<Builtin> {
        BUILTINS.get(number as usize).map(|info| info.builtin)
    }

    /// Its number.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// Its row.
    pub fn info(self) -> &'static BuiltinInfo {
        &BUILTINS[self as usize]
    }
}

define_builtins! {
    // ---- definitions
    /// Makes `function` the global function named by `symbol`, and returns `symbol`.
    SetFunction = internal "%SET-FUNCTION" ("symbol function");
    /// Makes `function` the macro function of `symbol`, and returns `symbol`.
    SetMacro = internal "%SET-MACRO" ("symbol function");
    /// Makes `symbol` a special variable, and returns it.
    ProclaimSpecial = internal "%PROCLAIM-SPECIAL" ("symbol");
    /// Makes `symbol` a constant with `value`, and returns it. Fails if it is a constant with another value.
    DefineConstant = internal "%DEFINE-CONSTANT" ("symbol value");

    // ---- functions and values
    /// Calls `function`, or the function that a symbol names, with `arguments`.
    Funcall = cl "FUNCALL" ("function &rest arguments");
    /// Calls `function` with `arguments`, the last of which is a list of further arguments.
    Apply = cl "APPLY" ("function argument &rest arguments");
    /// Its arguments, as multiple values.
    Values = cl "VALUES" ("&rest values");
    /// The items of `list`, as multiple values.
    ValuesList = cl "VALUES-LIST" ("list");
    /// Its argument.
    Identity = cl "IDENTITY" ("object");

    // ---- identity and types
    /// Whether both are the same object.
    Eq = cl "EQ" ("left right");
    /// Whether both are the same object, or equal numbers of one type, or equal characters.
    Eql = cl "EQL" ("left right");
    /// Whether `object` is `NIL`.
    Not = cl "NOT" ("object");
    /// Whether `object` is `NIL`.
    Null = cl "NULL" ("object");
    /// Whether `object` is a pair.
    Consp = cl "CONSP" ("object");
    /// Whether `object` is anything but a pair.
    Atom = cl "ATOM" ("object");
    /// Whether `object` is a pair or `NIL`.
    Listp = cl "LISTP" ("object");
    /// Whether `object` is a symbol.
    Symbolp = cl "SYMBOLP" ("object");
    /// Whether `object` is a keyword.
    Keywordp = cl "KEYWORDP" ("object");
    /// Whether `object` is a number.
    Numberp = cl "NUMBERP" ("object");
    /// Whether `object` is an integer, a ratio or a float.
    Realp = cl "REALP" ("object");
    /// Whether `object` is an integer or a ratio.
    Rationalp = cl "RATIONALP" ("object");
    /// Whether `object` is an integer.
    Integerp = cl "INTEGERP" ("object");
    /// Whether `object` is a float.
    Floatp = cl "FLOATP" ("object");
    /// Whether `object` is a character.
    Characterp = cl "CHARACTERP" ("object");
    /// Whether `object` is a string.
    Stringp = cl "STRINGP" ("object");
    /// Whether `object` is an array of rank 1.
    Vectorp = cl "VECTORP" ("object");
    /// Whether `object` is a simple general vector.
    SimpleVectorp = cl "SIMPLE-VECTOR-P" ("object");
    /// Whether `object` is an array.
    Arrayp = cl "ARRAYP" ("object");
    /// Whether `object` is a function.
    Functionp = cl "FUNCTIONP" ("object");
    /// Whether `object` is a hash table.
    HashTablep = cl "HASH-TABLE-P" ("object");
    /// Whether both are equal numbers or characters, strings of the same characters, or pairs of equal parts.
    Equal = cl "EQUAL" ("left right") slowly "%SLOW-EQUAL";
    /// Whether both look alike: as `equal`, but case and the type of numbers do not matter, and arrays, structures
    /// and hash tables are compared by their parts.
    Equalp = cl "EQUALP" ("left right") slowly "%SLOW-EQUALP";
    /// A number that `equal` objects share.
    Sxhash = cl "SXHASH" ("object");
    /// Whether `object` is a string without a fill pointer.
    SimpleStringp = cl "SIMPLE-STRING-P" ("object");

    // ---- numbers
    /// The sum; 0 of no numbers.
    Add = cl "+" ("&rest numbers") slowly "%SLOW-+";
    /// The first number less the others; the negative of a single one.
    Subtract = cl "-" ("number &rest numbers") slowly "%SLOW--";
    /// The product; 1 of no numbers.
    Multiply = cl "*" ("&rest numbers") slowly "%SLOW-*";
    /// The first number divided by the others; the reciprocal of a single one. Exact for integers and ratios.
    Divide = cl "/" ("number &rest numbers") slowly "%SLOW-/";
    /// `number` plus one.
    Increment = cl "1+" ("number");
    /// `number` less one.
    Decrement = cl "1-" ("number");
    /// Quotient rounded towards minus infinity, and remainder.
    Floor = cl "FLOOR" ("number &optional divisor") slowly "%SLOW-FLOOR";
    /// Quotient rounded towards plus infinity, and remainder.
    Ceiling = cl "CEILING" ("number &optional divisor") slowly "%SLOW-CEILING";
    /// Quotient rounded towards zero, and remainder.
    Truncate = cl "TRUNCATE" ("number &optional divisor") slowly "%SLOW-TRUNCATE";
    /// Quotient rounded to the nearest integer, halves to the even one, and remainder.
    Round = cl "ROUND" ("number &optional divisor") slowly "%SLOW-ROUND";
    /// The remainder of `floor`.
    Mod = cl "MOD" ("number divisor") slowly "%SLOW-MOD";
    /// The remainder of `truncate`.
    Rem = cl "REM" ("number divisor") slowly "%SLOW-REM";
    /// The numbers' bitwise and; -1 of none.
    LogAnd = cl "LOGAND" ("&rest integers") slowly "%SLOW-LOGAND";
    /// The numbers' bitwise or; 0 of none.
    LogIor = cl "LOGIOR" ("&rest integers") slowly "%SLOW-LOGIOR";
    /// The numbers' bitwise exclusive or; 0 of none.
    LogXor = cl "LOGXOR" ("&rest integers") slowly "%SLOW-LOGXOR";
    /// `integer` shifted left by `count` bits, right if that is negative.
    Ash = cl "ASH" ("integer count");
    /// Whether all numbers are equal.
    NumEqual = cl "=" ("number &rest numbers");
    /// Whether no two numbers are equal.
    NumNotEqual = cl "/=" ("number &rest numbers") slowly "%SLOW-/=";
    /// Whether the numbers increase.
    Less = cl "<" ("number &rest numbers");
    /// Whether the numbers never decrease.
    LessEqual = cl "<=" ("number &rest numbers");
    /// Whether the numbers decrease.
    Greater = cl ">" ("number &rest numbers");
    /// Whether the numbers never increase.
    GreaterEqual = cl ">=" ("number &rest numbers");
    /// Whether `number` is zero.
    Zerop = cl "ZEROP" ("number");
    /// Whether `number` is above zero.
    Plusp = cl "PLUSP" ("number");
    /// Whether `number` is below zero.
    Minusp = cl "MINUSP" ("number");
    /// The greatest of the numbers.
    Max = cl "MAX" ("number &rest numbers");
    /// The least of the numbers.
    Min = cl "MIN" ("number &rest numbers");
    /// The number without its sign.
    Abs = cl "ABS" ("number");
    /// -1, 0 or 1, as `number` is below, at or above zero, as a number of its type.
    Signum = cl "SIGNUM" ("number");
    /// As `floor`, with the quotient as a float.
    FFloor = cl "FFLOOR" ("number &optional divisor") slowly "%SLOW-FFLOOR";
    /// As `ceiling`, with the quotient as a float.
    FCeiling = cl "FCEILING" ("number &optional divisor") slowly "%SLOW-FCEILING";
    /// As `truncate`, with the quotient as a float.
    FTruncate = cl "FTRUNCATE" ("number &optional divisor") slowly "%SLOW-FTRUNCATE";
    /// As `round`, with the quotient as a float.
    FRound = cl "FROUND" ("number &optional divisor") slowly "%SLOW-FROUND";
    /// `base` to the power of `power`: exact for rationals and integer powers.
    Expt = cl "EXPT" ("base power") slowly "%SLOW-EXPT";
    /// The square root, a float. That of a negative number is an `arithmetic-error`.
    Sqrt = cl "SQRT" ("number");
    /// e to the power of `number`.
    Exp = cl "EXP" ("number");
    /// The logarithm, natural unless a base is given. That of a negative number is an `arithmetic-error`.
    Log = cl "LOG" ("number &optional base");
    /// The sine.
    Sin = cl "SIN" ("radians");
    /// The cosine.
    Cos = cl "COS" ("radians");
    /// The tangent.
    Tan = cl "TAN" ("radians");
    /// The angle with this sine.
    Asin = cl "ASIN" ("number");
    /// The angle with this cosine.
    Acos = cl "ACOS" ("number");
    /// The angle with this tangent; of two arguments, the angle of the point with `number` above and `divisor` to the
    /// right.
    Atan = cl "ATAN" ("number &optional divisor");
    /// The hyperbolic sine.
    Sinh = cl "SINH" ("number");
    /// The hyperbolic cosine.
    Cosh = cl "COSH" ("number");
    /// The hyperbolic tangent.
    Tanh = cl "TANH" ("number");
    /// The number with this hyperbolic sine.
    Asinh = cl "ASINH" ("number");
    /// The number with this hyperbolic cosine.
    Acosh = cl "ACOSH" ("number");
    /// The number with this hyperbolic tangent.
    Atanh = cl "ATANH" ("number");
    /// What is above the line in lowest terms.
    Numerator = cl "NUMERATOR" ("rational");
    /// What is below the line in lowest terms; 1 for an integer.
    Denominator = cl "DENOMINATOR" ("rational");
    /// The ratio of two integers that have no divisor in common; the second is above 1.
    MakeRatio = internal "%MAKE-RATIO" ("numerator denominator");
    /// The rational of exactly this value.
    Rational = cl "RATIONAL" ("number");
    /// The simplest rational that reads as this float.
    Rationalize = cl "RATIONALIZE" ("number");
    /// The nearest float.
    Float = cl "FLOAT" ("number &optional prototype");
    /// Fraction from 0.5 to below 1, exponent, and sign as a float.
    DecodeFloat = cl "DECODE-FLOAT" ("float");
    /// Mantissa, exponent and sign as integers.
    IntegerDecodeFloat = cl "INTEGER-DECODE-FLOAT" ("float");
    /// `float` times two to the power of `exponent`.
    ScaleFloat = cl "SCALE-FLOAT" ("float exponent");
    /// `magnitude`, which is 1.0 unless given, with the sign of `float`.
    FloatSign = cl "FLOAT-SIGN" ("float &optional magnitude");
    /// Number of binary digits of the type of `float`.
    FloatDigits = cl "FLOAT-DIGITS" ("float");
    /// Base of the representation of floats.
    FloatRadix = cl "FLOAT-RADIX" ("float");
    /// Number of significant binary digits of `float`.
    FloatPrecision = cl "FLOAT-PRECISION" ("float");
    /// The float as `prin1` writes it.
    FloatString = internal "%FLOAT-STRING" ("float");
    /// Where the point goes and the decimal digits of a float without its sign: the value is 0.digits times ten to
    /// the first value. Without `position` the shortest digits that read back; else those down to ten to the power of
    /// `position`.
    DecimalDigits = internal "%FLOAT-DIGITS" ("float &optional position");
    /// A random state: from the seed of the run for `NIL`, from an integer as the seed, or a copy.
    MakeRandomState = internal "%MAKE-RANDOM-STATE" ("source");
    /// A number from 0 to below `limit`, of its type; moves `state` on.
    Random = internal "%RANDOM" ("limit state");
    /// Whether `object` is a random state.
    RandomStatep = cl "RANDOM-STATE-P" ("object");

    // ---- integers
    /// Whether `integer` is even.
    Evenp = cl "EVENP" ("integer");
    /// Whether `integer` is odd.
    Oddp = cl "ODDP" ("integer");
    /// The greatest common divisor; 0 of none.
    Gcd = cl "GCD" ("&rest integers") slowly "%SLOW-GCD";
    /// Two smaller integers with the same greatest common divisor as `left` and `right`; the second is 0 when the
    /// first is the divisor.
    GcdStep = internal "%GCD-STEP" ("left right") slowly "%SLOW-GCD-STEP";
    /// The least common multiple; 1 of none.
    Lcm = cl "LCM" ("&rest integers") slowly "%SLOW-LCM";
    /// The greatest integer whose square is not above `integer`.
    Isqrt = cl "ISQRT" ("integer") slowly "%SLOW-ISQRT";
    /// The numbers' bitwise equivalence; -1 of none.
    LogEqv = cl "LOGEQV" ("&rest integers") slowly "%SLOW-LOGEQV";
    /// All bits turned over.
    LogNot = cl "LOGNOT" ("integer");
    /// Bits of `right` that are not in `left`.
    LogAndC1 = cl "LOGANDC1" ("left right");
    /// Bits of `left` that are not in `right`.
    LogAndC2 = cl "LOGANDC2" ("left right");
    /// Bits that are not in both.
    LogNand = cl "LOGNAND" ("left right");
    /// Bits that are in neither.
    LogNor = cl "LOGNOR" ("left right");
    /// Bits of `right` and those that are not in `left`.
    LogOrC1 = cl "LOGORC1" ("left right");
    /// Bits of `left` and those that are not in `right`.
    LogOrC2 = cl "LOGORC2" ("left right");
    /// Whether the numbers have a bit in common.
    LogTest = cl "LOGTEST" ("left right");
    /// Whether bit `index` is set.
    LogBitp = cl "LOGBITP" ("index integer");
    /// Number of ones; of zeros in a negative integer.
    LogCount = cl "LOGCOUNT" ("integer");
    /// Bits that the integer takes in two's complement, the sign not counted.
    IntegerLength = cl "INTEGER-LENGTH" ("integer");
    /// The field of `size` bits from `position` up.
    LoadByte = internal "%LDB" ("size position integer");
    /// `integer` with the field of `size` bits from `position` up taken from `new`.
    DepositByte = internal "%DPB" ("new size position integer");
    /// The digits of `integer` in `radix`, with its sign.
    IntegerString = internal "%INTEGER-STRING" ("integer radix") slowly "%SLOW-INTEGER-STRING";
    /// The integer that part of a string is, and where reading stopped.
    ParseInteger = internal "%PARSE-INTEGER" ("string start end radix junk-allowed") slowly "%SLOW-PARSE-INTEGER";

    // ---- characters
    /// The code of a character.
    CharCode = cl "CHAR-CODE" ("character");
    /// The code of a character.
    CharInt = cl "CHAR-INT" ("character");
    /// The character with this code.
    CodeChar = cl "CODE-CHAR" ("code");
    /// The character that a character, or a string or symbol of one, stands for.
    ToCharacter = cl "CHARACTER" ("designator");
    /// The upper case of a letter; other characters as they are.
    CharUpcase = cl "CHAR-UPCASE" ("character");
    /// The lower case of a letter; other characters as they are.
    CharDowncase = cl "CHAR-DOWNCASE" ("character");
    /// Whether `character` is a letter in upper case.
    UpperCasep = cl "UPPER-CASE-P" ("character");
    /// Whether `character` is a letter in lower case.
    LowerCasep = cl "LOWER-CASE-P" ("character");
    /// Whether `character` is a letter with upper and lower case.
    BothCasep = cl "BOTH-CASE-P" ("character");
    /// Whether `character` is a letter.
    AlphaCharp = cl "ALPHA-CHAR-P" ("character");
    /// Whether `character` is a letter or a digit.
    Alphanumericp = cl "ALPHANUMERICP" ("character");
    /// Whether `character` prints as itself.
    GraphicCharp = cl "GRAPHIC-CHAR-P" ("character");
    /// Whether `character` is one that every Common Lisp has.
    StandardCharp = cl "STANDARD-CHAR-P" ("character");
    /// The weight of a digit, `NIL` for any other character.
    DigitCharp = cl "DIGIT-CHAR-P" ("character &optional radix");
    /// The digit of this weight, `NIL` if there is none.
    DigitChar = cl "DIGIT-CHAR" ("weight &optional radix");
    /// The name of a character, `NIL` if it has none.
    CharName = cl "CHAR-NAME" ("character");
    /// The character of this name, `NIL` if there is none.
    NameChar = cl "NAME-CHAR" ("name");
    /// Whether all characters are the same.
    CharEqualExactly = cl "CHAR=" ("character &rest characters");
    /// Whether no two characters are the same.
    CharNotEqualExactly = cl "CHAR/=" ("character &rest characters");
    /// Whether the codes increase.
    CharLess = cl "CHAR<" ("character &rest characters");
    /// Whether the codes decrease.
    CharGreater = cl "CHAR>" ("character &rest characters");
    /// Whether the codes never decrease.
    CharLessEqual = cl "CHAR<=" ("character &rest characters");
    /// Whether the codes never increase.
    CharGreaterEqual = cl "CHAR>=" ("character &rest characters");
    /// As `char=`, whatever the case.
    CharEqual = cl "CHAR-EQUAL" ("character &rest characters");
    /// As `char/=`, whatever the case.
    CharNotEqual = cl "CHAR-NOT-EQUAL" ("character &rest characters");
    /// As `char<`, whatever the case.
    CharLessp = cl "CHAR-LESSP" ("character &rest characters");
    /// As `char>`, whatever the case.
    CharGreaterp = cl "CHAR-GREATERP" ("character &rest characters");
    /// As `char<=`, whatever the case.
    CharNotGreaterp = cl "CHAR-NOT-GREATERP" ("character &rest characters");
    /// As `char>=`, whatever the case.
    CharNotLessp = cl "CHAR-NOT-LESSP" ("character &rest characters");

    // ---- strings
    /// The string that a string, symbol or character stands for.
    String = cl "STRING" ("designator");
    /// Character `index` of a string.
    Char = cl "CHAR" ("string index");
    /// Character `index` of a string.
    Schar = cl "SCHAR" ("string index");
    /// Makes `character` character `index` of a string, and returns it.
    SetChar = internal "%SET-CHAR" ("string index character");
    /// A fresh string of `size` times `character`.
    MakeString = internal "%MAKE-STRING" ("size character") slowly "%SLOW-MAKE-STRING";
    /// Whether two parts of strings are the same.
    StringEqualExactly = internal "%STRING=" ("left right &optional start1 end1 start2 end2") slowly "%SLOW-STRING=";
    /// Whether two parts of strings are the same, whatever the case.
    StringEqualLoosely = internal "%STRING-EQUAL" ("left right &optional start1 end1 start2 end2") slowly "%SLOW-STRING-EQUAL";
    /// -1, 0 or 1, as the first of two parts of strings is before, the same as, or behind the other, and the index in
    /// the first where they begin to differ; with `fold`, whatever the case.
    StringCompare = internal "%STRING-COMPARE" ("left right start1 end1 start2 end2 fold") slowly "%SLOW-STRING-COMPARE";
    /// A fresh string, the part in upper case.
    StringUpcase = internal "%STRING-UPCASE" ("string start end") slowly "%SLOW-STRING-UPCASE";
    /// A fresh string, the part in lower case.
    StringDowncase = internal "%STRING-DOWNCASE" ("string start end") slowly "%SLOW-STRING-DOWNCASE";
    /// A fresh string, the words of the part capitalized.
    StringCapitalize = internal "%STRING-CAPITALIZE" ("string start end") slowly "%SLOW-STRING-CAPITALIZE";
    /// The string, the part changed to upper case.
    NStringUpcase = internal "%NSTRING-UPCASE" ("string start end") slowly "%SLOW-NSTRING-UPCASE";
    /// The string, the part changed to lower case.
    NStringDowncase = internal "%NSTRING-DOWNCASE" ("string start end") slowly "%SLOW-NSTRING-DOWNCASE";
    /// The string, the words of the part capitalized.
    NStringCapitalize = internal "%NSTRING-CAPITALIZE" ("string start end") slowly "%SLOW-NSTRING-CAPITALIZE";
    /// The string without the characters of `bag` at both ends.
    StringTrim = cl "STRING-TRIM" ("bag string") slowly "%SLOW-STRING-TRIM";
    /// The string without the characters of `bag` at its beginning.
    StringLeftTrim = cl "STRING-LEFT-TRIM" ("bag string") slowly "%SLOW-STRING-LEFT-TRIM";
    /// The string without the characters of `bag` at its end.
    StringRightTrim = cl "STRING-RIGHT-TRIM" ("bag string") slowly "%SLOW-STRING-RIGHT-TRIM";
    /// The strings joined.
    StringConcat = internal "%STRING-CONCAT" ("&rest strings") slowly "%SLOW-STRING-CONCAT";
    /// Where the pattern first is in a part of a string, or last with `from-end`; `NIL` if nowhere.
    SearchString = internal "%SEARCH-STRING" ("pattern string start end from-end") slowly "%SLOW-SEARCH-STRING";
    /// The string as `prin1` writes it.
    StringEscaped = internal "%STRING-ESCAPED" ("string") slowly "%SLOW-STRING-ESCAPED";
    /// The character as `prin1` writes it.
    CharacterEscaped = internal "%CHARACTER-ESCAPED" ("character");
    /// The name of a symbol as it is written, without package: in upper case (`case` 0), lower case (1) or
    /// capitalized (2), between bars if `escape` and it would not read back.
    SymbolNameString = internal "%SYMBOL-NAME-STRING" ("name case escape") slowly "%SLOW-SYMBOL-NAME-STRING";

    // ---- lists
    /// A fresh pair.
    Cons = cl "CONS" ("car cdr");
    /// The car of a pair, `NIL` of `NIL`.
    Car = cl "CAR" ("list");
    /// The cdr of a pair, `NIL` of `NIL`.
    Cdr = cl "CDR" ("list");
    /// The car of the cdr.
    Cadr = cl "CADR" ("list");
    /// The cdr of the cdr.
    Cddr = cl "CDDR" ("list");
    /// The first item of a list, `NIL` if there is none.
    First = cl "FIRST" ("list");
    /// The list without its first item.
    Rest = cl "REST" ("list");
    /// The second item of a list, `NIL` if there is none.
    Second = cl "SECOND" ("list");
    /// Makes `object` the car of `pair`, and returns `pair`.
    Rplaca = cl "RPLACA" ("pair object");
    /// Makes `object` the cdr of `pair`, and returns `pair`.
    Rplacd = cl "RPLACD" ("pair object");
    /// Makes `value` the car of `pair`, and returns `value`.
    SetCar = internal "%SET-CAR" ("pair value");
    /// Makes `value` the cdr of `pair`, and returns `value`.
    SetCdr = internal "%SET-CDR" ("pair value");
    /// A fresh list of `objects`.
    List = cl "LIST" ("&rest objects");
    /// A list of the objects that ends in the last of them.
    ListStar = cl "LIST*" ("object &rest objects");
    /// The lists joined: all but the last are copied.
    Append = cl "APPEND" ("&rest lists") slowly "%SLOW-APPEND";
    /// The car of the car.
    Caar = cl "CAAR" ("list");
    /// The cdr of the car.
    Cdar = cl "CDAR" ("list");
    /// The car of the car of the car.
    Caaar = cl "CAAAR" ("list");
    /// The car of the car of the cdr.
    Caadr = cl "CAADR" ("list");
    /// The car of the cdr of the car.
    Cadar = cl "CADAR" ("list");
    /// The car of the cdr of the cdr.
    Caddr = cl "CADDR" ("list");
    /// The cdr of the car of the car.
    Cdaar = cl "CDAAR" ("list");
    /// The cdr of the car of the cdr.
    Cdadr = cl "CDADR" ("list");
    /// The cdr of the cdr of the car.
    Cddar = cl "CDDAR" ("list");
    /// The cdr of the cdr of the cdr.
    Cdddr = cl "CDDDR" ("list");
    /// The car of the car of the car of the car.
    Caaaar = cl "CAAAAR" ("list");
    /// The car of the car of the car of the cdr.
    Caaadr = cl "CAAADR" ("list");
    /// The car of the car of the cdr of the car.
    Caadar = cl "CAADAR" ("list");
    /// The car of the car of the cdr of the cdr.
    Caaddr = cl "CAADDR" ("list");
    /// The car of the cdr of the car of the car.
    Cadaar = cl "CADAAR" ("list");
    /// The car of the cdr of the car of the cdr.
    Cadadr = cl "CADADR" ("list");
    /// The car of the cdr of the cdr of the car.
    Caddar = cl "CADDAR" ("list");
    /// The car of the cdr of the cdr of the cdr.
    Cadddr = cl "CADDDR" ("list");
    /// The cdr of the car of the car of the car.
    Cdaaar = cl "CDAAAR" ("list");
    /// The cdr of the car of the car of the cdr.
    Cdaadr = cl "CDAADR" ("list");
    /// The cdr of the car of the cdr of the car.
    Cdadar = cl "CDADAR" ("list");
    /// The cdr of the car of the cdr of the cdr.
    Cdaddr = cl "CDADDR" ("list");
    /// The cdr of the cdr of the car of the car.
    Cddaar = cl "CDDAAR" ("list");
    /// The cdr of the cdr of the car of the cdr.
    Cddadr = cl "CDDADR" ("list");
    /// The cdr of the cdr of the cdr of the car.
    Cdddar = cl "CDDDAR" ("list");
    /// The cdr of the cdr of the cdr of the cdr.
    Cddddr = cl "CDDDDR" ("list");
    /// The third item of a list, `NIL` if there is none.
    Third = cl "THIRD" ("list");
    /// The fourth item of a list, `NIL` if there is none.
    Fourth = cl "FOURTH" ("list");
    /// The fifth item of a list, `NIL` if there is none.
    Fifth = cl "FIFTH" ("list");
    /// The sixth item of a list, `NIL` if there is none.
    Sixth = cl "SIXTH" ("list");
    /// The seventh item of a list, `NIL` if there is none.
    Seventh = cl "SEVENTH" ("list");
    /// The eighth item of a list, `NIL` if there is none.
    Eighth = cl "EIGHTH" ("list");
    /// The ninth item of a list, `NIL` if there is none.
    Ninth = cl "NINTH" ("list");
    /// The tenth item of a list, `NIL` if there is none.
    Tenth = cl "TENTH" ("list");
    /// Whether a list is empty; for anything but a list it fails.
    Endp = cl "ENDP" ("list");
    /// Item `index` of a list, `NIL` if there is none.
    Nth = cl "NTH" ("index list") slowly "%SLOW-NTH";
    /// The list without its first `count` items.
    Nthcdr = cl "NTHCDR" ("count list") slowly "%SLOW-NTHCDR";
    /// The last `count` pairs of a list, one unless said otherwise.
    Last = cl "LAST" ("list &optional count") slowly "%SLOW-LAST";
    /// A copy of the list without its last `count` pairs, one unless said otherwise.
    Butlast = cl "BUTLAST" ("list &optional count") slowly "%SLOW-BUTLAST";
    /// The list, its last `count` pairs cut off.
    NButlast = cl "NBUTLAST" ("list &optional count") slowly "%SLOW-NBUTLAST";
    /// Number of items of a list, `NIL` if it is circular.
    ListLength = cl "LIST-LENGTH" ("list") slowly "%SLOW-LIST-LENGTH";
    /// A fresh list of `size` times `item`.
    MakeList = internal "%MAKE-LIST" ("size item") slowly "%SLOW-MAKE-LIST";
    /// `alist` with a pair of `key` and `value` in front.
    Acons = cl "ACONS" ("key value alist");
    /// The lists joined: the end of each is changed to the next.
    NConc = cl "NCONC" ("&rest lists") slowly "%SLOW-NCONC";
    /// The items of `list` in reverse order, in front of `tail`.
    RevAppend = cl "REVAPPEND" ("list tail") slowly "%SLOW-REVAPPEND";
    /// As `revappend`, from the pairs of `list`.
    NReconc = cl "NRECONC" ("list tail") slowly "%SLOW-NRECONC";
    /// A fresh list of the same items.
    CopyList = cl "COPY-LIST" ("list") slowly "%SLOW-COPY-LIST";
    /// A fresh list with fresh pairs for those that are its items.
    CopyAlist = cl "COPY-ALIST" ("alist") slowly "%SLOW-COPY-ALIST";
    /// A fresh tree of pairs with the same leaves.
    CopyTree = cl "COPY-TREE" ("tree") slowly "%SLOW-COPY-TREE";
    /// A fresh list of the items in front of the tail that is `object`.
    Ldiff = cl "LDIFF" ("list object") slowly "%SLOW-LDIFF";
    /// Whether `object` is a tail of `list`.
    Tailp = cl "TAILP" ("object list") slowly "%SLOW-TAILP";
    /// `alist` with a pair for each key and datum in front.
    Pairlis = cl "PAIRLIS" ("keys data &optional alist") slowly "%SLOW-PAIRLIS";
    /// The tail of `list` that begins with an item `eq` to `item`, or `NIL`.
    MemberEq = internal "%MEMBER-EQ" ("item list") slowly "%SLOW-MEMBER-EQ";
    /// The tail of `list` that begins with an item `eql` to `item`, or `NIL`.
    MemberEql = internal "%MEMBER-EQL" ("item list") slowly "%SLOW-MEMBER-EQL";
    /// The tail of `list` that begins with an item `equal` to `item`, or `NIL`.
    MemberEqual = internal "%MEMBER-EQUAL" ("item list") slowly "%SLOW-MEMBER-EQUAL";
    /// The first pair of `alist` whose key is `eq` to `item`, or `NIL`.
    AssocEq = internal "%ASSOC-EQ" ("item alist") slowly "%SLOW-ASSOC-EQ";
    /// The first pair of `alist` whose key is `eql` to `item`, or `NIL`.
    AssocEql = internal "%ASSOC-EQL" ("item alist") slowly "%SLOW-ASSOC-EQL";
    /// The first pair of `alist` whose key is `equal` to `item`, or `NIL`.
    AssocEqual = internal "%ASSOC-EQUAL" ("item alist") slowly "%SLOW-ASSOC-EQUAL";
    /// The first pair of `alist` whose value is `eq` to `item`, or `NIL`.
    RassocEq = internal "%RASSOC-EQ" ("item alist") slowly "%SLOW-RASSOC-EQ";
    /// The first pair of `alist` whose value is `eql` to `item`, or `NIL`.
    RassocEql = internal "%RASSOC-EQL" ("item alist") slowly "%SLOW-RASSOC-EQL";
    /// The first pair of `alist` whose value is `equal` to `item`, or `NIL`.
    RassocEqual = internal "%RASSOC-EQUAL" ("item alist") slowly "%SLOW-RASSOC-EQUAL";
    /// `list` with `item` in front, unless it has it.
    AdjoinEql = internal "%ADJOIN-EQL" ("item list") slowly "%SLOW-ADJOIN-EQL";
    /// The value of a property of a property list, `default` if there is none.
    Getf = cl "GETF" ("plist indicator &optional default") slowly "%SLOW-GETF";
    /// The property list with this property: changed if it is there, else with it in front.
    Putf = internal "%PUTF" ("plist indicator value") slowly "%SLOW-PUTF";
    /// The property list without this property, and whether it was there.
    Remf = internal "%REMF" ("plist indicator") slowly "%SLOW-REMF";
    /// Indicator and value of the first property that is among `indicators`, and the tail that begins there; three
    /// times `NIL` if there is none.
    GetProperties = cl "GET-PROPERTIES" ("plist indicators") slowly "%SLOW-GET-PROPERTIES";

    // ---- sequences
    /// Number of elements.
    Length = cl "LENGTH" ("sequence") slowly "%SLOW-LENGTH";
    /// Element `index` of a list or vector.
    Elt = cl "ELT" ("sequence index") slowly "%SLOW-ELT";
    /// Makes `value` element `index` of a list or vector, and returns `value`.
    SetElt = internal "%SET-ELT" ("sequence index value") slowly "%SLOW-SET-ELT";
    /// A fresh sequence of the elements from `start` to before `end`.
    Subseq = cl "SUBSEQ" ("sequence start &optional end") slowly "%SLOW-SUBSEQ";
    /// A fresh sequence of the same elements.
    CopySeq = cl "COPY-SEQ" ("sequence") slowly "%SLOW-COPY-SEQ";
    /// A fresh sequence of the elements in reverse order.
    Reverse = cl "REVERSE" ("sequence") slowly "%SLOW-REVERSE";
    /// The sequence turned round in place.
    NReverse = cl "NREVERSE" ("sequence") slowly "%SLOW-NREVERSE";
    /// Makes `item` every element of a part of a vector, and returns the vector.
    Fill = internal "%FILL" ("vector item start end") slowly "%SLOW-FILL";
    /// Copies a part of the vector `source` over a part of the vector `target`, and returns that.
    Replace = internal "%REPLACE" ("target source start1 end1 start2 end2") slowly "%SLOW-REPLACE";
    /// A fresh simple vector of the items of a list.
    ListVector = internal "%LIST-VECTOR" ("list") slowly "%SLOW-LIST-VECTOR";
    /// A fresh string of the characters in a list.
    ListString = internal "%LIST-STRING" ("list") slowly "%SLOW-LIST-STRING";
    /// A fresh list of the elements of a part of a vector.
    VectorList = internal "%VECTOR-LIST" ("vector start end") slowly "%SLOW-VECTOR-LIST";
    /// Index of the first element, or the last with `from-end`, that is `eql` to `item`; `NIL` if there is none.
    PositionEql = internal "%POSITION-EQL" ("item sequence start end from-end") slowly "%SLOW-POSITION-EQL";
    /// Index of the first element, or the last with `from-end`, that is `equal` to `item`; `NIL` if there is none.
    PositionEqual = internal "%POSITION-EQUAL" ("item sequence start end from-end") slowly "%SLOW-POSITION-EQUAL";
    /// Number of elements that are `eql` to `item`.
    CountEql = internal "%COUNT-EQL" ("item sequence start end") slowly "%SLOW-COUNT-EQL";
    /// The list without the items that are `eql` to `item`.
    RemoveEql = internal "%REMOVE-EQL" ("item list") slowly "%SLOW-REMOVE-EQL";

    // ---- arrays
    /// A fresh simple vector of `objects`.
    Vector = cl "VECTOR" ("&rest objects");
    /// Element `index` of a simple general vector.
    Svref = cl "SVREF" ("vector index");
    /// Makes `value` element `index` of a simple general vector, and returns `value`.
    SetSvref = internal "%SET-SVREF" ("vector index value");
    /// The element of `array` that the subscripts select.
    Aref = cl "AREF" ("array &rest subscripts");
    /// Sets the element of `array` that the subscripts select to the last argument, and returns that.
    SetAref = internal "%SET-AREF" ("array &rest subscripts-and-value");
    /// Element `index` of an array, counted row by row.
    RowMajorAref = cl "ROW-MAJOR-AREF" ("array index");
    /// Makes `value` element `index` of an array, counted row by row, and returns `value`.
    SetRowMajorAref = internal "%SET-ROW-MAJOR-AREF" ("array index value");
    /// The index, counted row by row, of the element that the subscripts select.
    ArrayRowMajorIndex = cl "ARRAY-ROW-MAJOR-INDEX" ("array &rest subscripts");
    /// Whether the subscripts select an element.
    ArrayInBoundsp = cl "ARRAY-IN-BOUNDS-P" ("array &rest subscripts");
    /// Number of elements, those behind a fill pointer too.
    ArrayTotalSize = cl "ARRAY-TOTAL-SIZE" ("array");
    /// Number of dimensions.
    ArrayRank = cl "ARRAY-RANK" ("array");
    /// List of the dimensions.
    ArrayDimensions = cl "ARRAY-DIMENSIONS" ("array");
    /// Dimension number `axis`.
    ArrayDimension = cl "ARRAY-DIMENSION" ("array axis");
    /// Whether the array has a fill pointer.
    ArrayHasFillPointerp = cl "ARRAY-HAS-FILL-POINTER-P" ("array");
    /// Whether the array was made to be adjustable.
    AdjustableArrayp = cl "ADJUSTABLE-ARRAY-P" ("array");
    /// What keeps the elements: a simple vector or string, the array itself if it is one.
    ArrayData = internal "%ARRAY-DATA" ("array");
    /// The fill pointer of a vector.
    FillPointer = cl "FILL-POINTER" ("vector");
    /// Makes `index` the fill pointer of a vector, and returns it.
    SetFillPointer = internal "%SET-FILL-POINTER" ("vector index");
    /// Puts `object` where the fill pointer is and moves that on; the index, or `NIL` if the vector is full.
    VectorPush = cl "VECTOR-PUSH" ("object vector");
    /// As `vector-push`; a full vector grows.
    VectorPushExtend = cl "VECTOR-PUSH-EXTEND" ("object vector &optional extension") slowly "%SLOW-VECTOR-PUSH-EXTEND";
    /// The element in front of the fill pointer, which moves back to it.
    VectorPop = cl "VECTOR-POP" ("vector");
    /// A fresh simple vector of `size` times `object`.
    MakeVector = internal "%MAKE-VECTOR" ("size object") slowly "%SLOW-MAKE-VECTOR";
    /// Memory for a simple vector or string of `size` elements, which is one when all have been filled.
    BeginVector = internal "%BEGIN-VECTOR" ("size string-p");
    /// Fills more elements of such a vector with `object`, or with 0 if that has an address; whether all are filled now.
    FillMore = internal "%FILL-MORE" ("vector object");
    /// An array that is not simple, over the simple vector or string `data`; `fill-pointer` is `NIL`, `T` or an
    /// index.
    MakeArray = internal "%MAKE-ARRAY" ("dimensions data fill-pointer adjustable");
    /// Gives an array that is not simple other dimensions, data and fill pointer, and returns it.
    AdjustArray = internal "%ADJUST-ARRAY" ("array dimensions data fill-pointer");

    // ---- hash tables
    /// A hash table: `test` is 0 for `eq`, 1 for `eql`, 2 for `equal`, 3 for `equalp`, 4 for the functions of a
    /// program.
    MakeHashTable = internal "%MAKE-HASH-TABLE" ("test size test-function hash-function");
    /// The value of `key`, or `default`, and whether the table has it.
    Gethash = cl "GETHASH" ("key table &optional default") slowly "%SLOW-GETHASH";
    /// Makes `value` the value of `key`, and returns it.
    Puthash = internal "%PUTHASH" ("key table value") slowly "%SLOW-PUTHASH";
    /// Adds `delta` to the value of `key`, or to `default` if it has none, and returns the sum.
    AddToValue = internal "%ADD-TO-VALUE" ("key table default delta") slowly "%SLOW-ADD-TO-VALUE";
    /// Takes `key` out of the table; whether it was there.
    Remhash = cl "REMHASH" ("key table") slowly "%SLOW-REMHASH";
    /// Takes everything out of the table, and returns it.
    Clrhash = cl "CLRHASH" ("table");
    /// Number of keys.
    HashTableCount = cl "HASH-TABLE-COUNT" ("table");
    /// Number of keys for which the table has room at present.
    HashTableSize = cl "HASH-TABLE-SIZE" ("table");
    /// The number of the test, as for `%make-hash-table`, and the functions of a program.
    HashTableTest = internal "%HASH-TABLE-TEST" ("table");
    /// The position behind the next entry from `position` on, its key and its value; `NIL` at the end. The first
    /// position is 0.
    TableNext = internal "%TABLE-NEXT" ("table position") slowly "%SLOW-TABLE-NEXT";
    /// A later position with the same next entry, some free entries on.
    TableSkip = internal "%TABLE-SKIP" ("table position");
    /// The hash of a key.
    TableHash = internal "%TABLE-HASH" ("table key");
    /// A fresh list of `(entry . key)` for the keys that have this hash.
    TableCandidates = internal "%TABLE-CANDIDATES" ("table hash");
    /// A number that changes whenever a key comes or goes.
    TableSerial = internal "%TABLE-SERIAL" ("table");
    /// The value of an entry, and whether it still has this very key.
    TableValue = internal "%TABLE-VALUE" ("table entry key");
    /// Gives an entry another value; whether that was done, as it still has this very key.
    SetTableValue = internal "%SET-TABLE-VALUE" ("table entry key value");
    /// Adds a key that the table does not have; whether that was done, as no key came or went since `serial`.
    TableAdd = internal "%TABLE-ADD" ("table hash key value serial");
    /// Takes an entry, whose key has this hash, out of the table; whether that was done, as it still has this very key.
    TableDelete = internal "%TABLE-DELETE" ("table entry key hash");

    // ---- structures
    /// Slot `index` of `instance`, which must be an instance of the class named `class` or a subclass.
    SlotOf = internal "%SLOT" ("class index instance");
    /// Makes `value` slot `index` of `instance`, and returns `value`.
    SetSlotOf = internal "%SET-SLOT" ("class index instance value");
    /// Whether `object` is an instance of the structure class named `class` or a subclass.
    IsInstance = internal "%INSTANCE-P" ("class object");

    // ---- failures and the control stack
    /// The innermost handlers below `height`, or of all if that is `NIL`, that no mask hides: index of the entry, its kind,
    /// and what goes with it: 0 and a list of `(type . function)`, 1 and the types of cases; for a `failure`, its condition
    /// or cause, also 2 and the table or state of recovery procedures, 3 for a cleanup. `NIL` if there are none. Those who
    /// watch the run are told of a failure for which all are searched.
    NextHandler = internal "%NEXT-HANDLER" ("height failure");
    /// Unwinds to the entry with this index, of the cases of a `handler-case`, and has one of them take the condition.
    TakeCase = internal "%TAKE-CASE" ("index case condition");
    /// The state of the recovery procedures of the entry with this index: `table` if it is one, otherwise a copy of it, made
    /// here, with their function first. Those who watch the run are told that there is recovery from `failure`.
    BeginRecovery = internal "%BEGIN-RECOVERY" ("index table failure");
    /// Has `values`, a list, stand for the values of the operation for whose failure this function of the library was called,
    /// and that the recovery procedures of the entry `index` have handled: if that is inside of functions of the library, for
    /// those of the outermost.
    StandIn = internal "%STAND-IN" ("index values");
    /// Unwinds to the cleanup for failures with this index, which has `failure` when it has run.
    UnwindToCleanup = internal "%UNWIND-TO-CLEANUP" ("index failure");
    /// What the innermost running cleanup was given by `%UNWIND-TO-CLEANUP`, or `NIL`.
    CleaningUp = internal "%CLEANING-UP" ("");
    /// Ends the running task as failed, with this condition: its text in a few words, and for people what has happened
    /// where, and the line that says that there is no recovery. In a cleanup of a task that ends already, or that leaves an
    /// expired limit, ends the cleanup, and the report goes with that of the task.
    EndTask = internal "%END-TASK" ("condition text story ending");
    /// Ends the run with this status, from 0 to 255. The remaining tasks are aborted.
    Exit = internal "%EXIT" ("status");
    /// The innermost `limit` frames, each a list of the function's name, and source, line and column if known. A function that
    /// has no name is `(lambda)`, a form at top level `NIL`.
    Backtrace = internal "%BACKTRACE" ("limit");
    /// Calls the embedder's function with this number.
    CallHost = internal "%CALL-HOST" ("number &rest arguments");

    // ---- symbols
    /// The name of a symbol, a string that is not to be changed.
    SymbolName = cl "SYMBOL-NAME" ("symbol");
    /// The home package of a symbol, or `NIL`.
    SymbolPackage = cl "SYMBOL-PACKAGE" ("symbol");
    /// The property list of a symbol.
    SymbolPlist = cl "SYMBOL-PLIST" ("symbol");
    /// Makes `plist` the property list of `symbol`, and returns it.
    SetSymbolPlist = internal "%SET-SYMBOL-PLIST" ("symbol plist");
    /// The property `indicator` of `symbol`, or `default`.
    Get = cl "GET" ("symbol indicator &optional default") slowly "%SLOW-GET";
    /// Makes `value` the property `indicator` of `symbol`, and returns it.
    Put = internal "%PUT" ("symbol indicator value") slowly "%SLOW-PUT";
    /// Removes the property `indicator` of `symbol`; whether it had one.
    Remprop = cl "REMPROP" ("symbol indicator") slowly "%SLOW-REMPROP";
    /// The value of the special variable `symbol`.
    SymbolValue = cl "SYMBOL-VALUE" ("symbol");
    /// Sets the special variable `symbol`, and returns `value`.
    Set = cl "SET" ("symbol value");
    /// Whether the special variable `symbol` has a value.
    Boundp = cl "BOUNDP" ("symbol");
    /// Takes the value of the special variable `symbol` away.
    Makunbound = cl "MAKUNBOUND" ("symbol");
    /// Whether `name`, a symbol or `(setf symbol)`, names a global function or macro.
    Fboundp = cl "FBOUNDP" ("name");
    /// The global function, or macro function, named by `symbol`.
    SymbolFunction = cl "SYMBOL-FUNCTION" ("symbol");
    /// The global function, or macro function, named by `name`, a symbol or `(setf symbol)`.
    Fdefinition = cl "FDEFINITION" ("name");
    /// Takes the function or macro named by `name` away.
    Fmakunbound = cl "FMAKUNBOUND" ("name");
    /// The symbol that keeps the function called `name`: itself, or for `(setf symbol)` one of the same package.
    FunctionCell = internal "%FUNCTION-CELL" ("name");
    /// The macro function of `symbol`, global or in `environment`, or `NIL`.
    MacroFunction = cl "MACRO-FUNCTION" ("symbol &optional environment");
    /// Whether `symbol` is proclaimed special.
    SpecialVariableP = internal "%SPECIAL-P" ("symbol");
    /// Whether `symbol` is a constant.
    ConstantSymbolP = internal "%CONSTANT-P" ("symbol");
    /// Whether `symbol` belongs to the language and may not be redefined.
    LockedP = internal "%LOCKED-P" ("symbol");
    /// A fresh symbol without a package.
    MakeSymbol = cl "MAKE-SYMBOL" ("name");
    /// A fresh symbol without a package, named by `prefix` and a number: `*gensym-counter*`, or `prefix` itself.
    Gensym = cl "GENSYM" ("&optional prefix");
    /// The name of a function, as its definition gives it, or `NIL`.
    FunctionName = internal "%FUNCTION-NAME" ("function");
    /// The lambda list of a function as it was written.
    FunctionLambdaList = internal "%FUNCTION-LAMBDA-LIST" ("function");
    /// The documentation string of a function, or `NIL`.
    FunctionDocumentation = internal "%FUNCTION-DOCUMENTATION" ("function");
    /// The least and the greatest number of arguments of a function; `NIL` in place of the second without a limit.
    FunctionArity = internal "%FUNCTION-ARITY" ("function");

    // ---- packages
    /// The package of this name or nickname, or `NIL`.
    FindPackage = cl "FIND-PACKAGE" ("name");
    /// Whether `object` is a package.
    Packagep = cl "PACKAGEP" ("object");
    /// The name of a package.
    PackageName = cl "PACKAGE-NAME" ("package");
    /// The other names of a package.
    PackageNicknames = cl "PACKAGE-NICKNAMES" ("package");
    /// The packages whose external symbols `package` inherits.
    PackageUseList = cl "PACKAGE-USE-LIST" ("package");
    /// All packages.
    ListAllPackages = cl "LIST-ALL-PACKAGES" ("");
    /// The package of this name, made if there is none, with these nicknames, and using these packages.
    MakePackage = internal "%MAKE-PACKAGE" ("name nicknames uses");
    /// Lets `package` inherit the external symbols of `packages`, a package or a list of packages.
    UsePackage = cl "USE-PACKAGE" ("packages &optional package");
    /// Makes `symbols`, a symbol or a list of symbols, external in `package`.
    Export = cl "EXPORT" ("symbols &optional package");
    /// Makes `symbols`, a symbol or a list of symbols, present in `package`.
    Import = cl "IMPORT" ("symbols &optional package");
    /// Gives `package` symbols of its own by these names.
    Shadow = cl "SHADOW" ("names &optional package");
    /// The symbol that `name` denotes in `package`, made if there is none; and how the package has it, `NIL` for new.
    Intern = cl "INTERN" ("name &optional package");
    /// The symbol that `name` denotes in `package`, and how the package has it; `NIL` twice if there is none.
    FindSymbol = cl "FIND-SYMBOL" ("name &optional package");
    /// All external symbols of a package, by name.
    ExternalSymbols = internal "%EXTERNAL-SYMBOLS" ("package");
    /// What is written before the name of a symbol in the current package: a string such as `:`, or `NIL`.
    SymbolQualifier = internal "%SYMBOL-QUALIFIER" ("symbol");

    // ---- structures and their classes
    /// The class of this name, kept if it has these superclasses (classes or their names) and slots (symbols), else made.
    MakeClass = internal "%MAKE-CLASS" ("name supers slots data");
    /// The class of this name, or `NIL`.
    FindClass = internal "%FIND-CLASS" ("name");
    /// The class of a structure or condition, `NIL` for everything else.
    ClassOf = internal "%CLASS-OF" ("object");
    /// Whether `object` is a class.
    Classp = internal "%CLASSP" ("object");
    /// The name of a class.
    ClassName = internal "%CLASS-NAME" ("class");
    /// The direct superclasses of a class.
    ClassSupers = internal "%CLASS-SUPERS" ("class");
    /// The names of the slots of a class, inherited ones first.
    ClassSlots = internal "%CLASS-SLOTS" ("class");
    /// What the library keeps about a class.
    ClassData = internal "%CLASS-DATA" ("class");
    /// Makes `data` what the library keeps about a class, and returns it.
    SetClassData = internal "%SET-CLASS-DATA" ("class data");
    /// Whether `class` is `ancestor` or inherits from it.
    SubclassP = internal "%SUBCLASS-P" ("class ancestor");
    /// A fresh instance of a class, or of the class of that name. Slots without a value are `NIL`.
    MakeStructure = internal "%MAKE-STRUCTURE" ("class &rest values");
    /// A copy of a structure.
    CopyStructure = cl "COPY-STRUCTURE" ("structure");
    /// Whether `object` is an instance of some class.
    Structurep = internal "%STRUCTUREP" ("object");
    /// Slot `index` of a structure of any class.
    StructureRef = internal "%STRUCTURE-REF" ("instance index");
    /// Makes `value` slot `index` of a structure of any class, and returns `value`.
    SetStructureRef = internal "%SET-STRUCTURE-REF" ("instance index value");
    /// Records that the function `name` reads slot `slot` of the class named `class`. Comes after the function.
    DefineAccessor = internal "%DEFINE-ACCESSOR" ("name class slot read-only");

    // ---- reading and compiling at run time
    /// A handle of the compilation of `form`.
    BeginCompilation = internal "%BEGIN-COMPILATION" ("form");
    /// A handle of the compilation of a whole text, called `name` in what is said about it.
    BeginFile = internal "%BEGIN-FILE" ("name text");
    /// The functions that run the top-level forms of a compiled file, in order.
    CompiledFile = internal "%COMPILED-FILE" ("path");
    /// A handle of a text that is compiled form by form. Functions of a text with a name know where they stand in it.
    OpenText = internal "%OPEN-TEXT" ("text &optional name");
    /// A handle of the compilation of the next form of a text, `NIL` at its end.
    NextForm = internal "%NEXT-FORM" ("handle");
    /// Tells a compilation what became of its last step, and returns the next one: `:expand` function form environment,
    /// `:load` functions keep, or `:done` functions diagnostics.
    CompilationStep = internal "%COMPILATION-STEP" ("handle kind outcome");
    /// Ends a compilation, or lets go of a text.
    EndCompilation = internal "%END-COMPILATION" ("handle");
    /// Reads a datum: whether there was one, or `:unfinished`; the datum; and the index after it.
    ReadDatum = internal "%READ-FROM-STRING" ("string &optional start end");
    /// Reads a datum from a stream: whether there was one, or `:unfinished`; and the datum.
    ReadStream = internal "%READ" ("&optional stream");

    // ---- streams
    /// Standard input, output or error: 0, 1 or 2.
    StandardStream = internal "%STANDARD-STREAM" ("number");
    /// A stream that reads the characters of `string` from `start` to before `end`.
    MakeStringInput = internal "%MAKE-STRING-INPUT" ("string start end") slowly "%SLOW-MAKE-STRING-INPUT";
    /// A stream that reads from `string`, which nobody else may have.
    ReadFromCopy = internal "%READ-FROM-COPY" ("string");
    /// How many characters of its string such a stream has read.
    StringInputPosition = internal "%STRING-INPUT-POSITION" ("stream");
    /// A stream that gathers what is written to it.
    MakeStringOutput = internal "%MAKE-STRING-OUTPUT" ("");
    /// What a string stream has gathered since this was last asked.
    GetOutputStreamString = cl "GET-OUTPUT-STREAM-STRING" ("stream") slowly "%SLOW-GET-OUTPUT-STREAM-STRING";
    /// How many characters a string stream has gathered since it was last asked for them.
    GatheredLength = internal "%GATHERED-LENGTH" ("stream");
    /// The strings in which a string stream has gathered them, the last first; it begins afresh. `NIL` if they are not `length`
    /// characters any more. The last string may be longer than what is in it.
    TakeGathered = internal "%TAKE-GATHERED" ("stream length");
    /// A stream that reads a text file.
    OpenInput = internal "%OPEN-INPUT" ("path");
    /// A stream that writes a text file: 0 replaces it, 1 appends to it, 2 fails if there is one.
    OpenOutput = internal "%OPEN-OUTPUT" ("path mode");
    /// Closes a stream; with `abort`, what it has gathered is dropped. Whether it was open.
    CloseStream = internal "%CLOSE" ("stream abort");
    /// The text of a file.
    FileText = internal "%FILE-TEXT" ("path");
    /// Whether there is a file of this name.
    FileExistsP = internal "%FILE-EXISTS-P" ("path");
    /// Removes a file.
    DeleteFile = internal "%DELETE-FILE" ("path");
    /// Whether `object` is a stream.
    Streamp = cl "STREAMP" ("object");
    /// Whether a stream can be read from.
    InputStreamP = cl "INPUT-STREAM-P" ("stream");
    /// Whether a stream can be written to.
    OutputStreamP = cl "OUTPUT-STREAM-P" ("stream");
    /// Whether a stream is open.
    OpenStreamP = cl "OPEN-STREAM-P" ("stream");
    /// `:standard`, `:string` or `:file`, and the name of the file.
    StreamSort = internal "%STREAM-SORT" ("stream");
    /// Characters since the last line end that was written to a stream.
    StreamColumn = internal "%STREAM-COLUMN" ("stream");
    /// The next character of a stream. Waits for standard input.
    ReadChar = cl "READ-CHAR" ("&optional stream eof-error-p eof-value recursive-p");
    /// The next character of a stream, or `NIL` if it would have to wait.
    ReadCharNoHang = cl "READ-CHAR-NO-HANG" ("&optional stream eof-error-p eof-value recursive-p");
    /// Whether a character of a stream is there to be read.
    Listen = cl "LISTEN" ("&optional stream");
    /// The next character of a stream, which stays there; with `T`, after white space; with a character, up to that.
    PeekChar = cl "PEEK-CHAR" ("&optional peek-type stream eof-error-p eof-value recursive-p") slowly "%SLOW-PEEK-CHAR";
    /// Puts the character that was read last back into a stream.
    UnreadChar = cl "UNREAD-CHAR" ("character &optional stream");
    /// The next line of a stream, and whether it has no line end. Waits for standard input.
    ReadLine = cl "READ-LINE" ("&optional stream eof-error-p eof-value recursive-p") slowly "%SLOW-READ-LINE";
    /// Writes a character to a stream, and returns it.
    WriteChar = cl "WRITE-CHAR" ("character &optional stream");
    /// Writes a part of a string to a stream, and returns the string.
    WriteStringPart = internal "%WRITE-STRING" ("string stream start end") slowly "%SLOW-WRITE-STRING";
    /// Ends the line that is being written to a stream.
    Terpri = cl "TERPRI" ("&optional stream");
    /// Ends the line that is being written to a stream, unless it is empty; whether it did.
    FreshLine = cl "FRESH-LINE" ("&optional stream");
    /// Writes what a stream has gathered.
    FinishOutput = cl "FINISH-OUTPUT" ("&optional stream");
    /// Writes what a stream has gathered.
    ForceOutput = cl "FORCE-OUTPUT" ("&optional stream");

    // ---- the logical database
    /// Adds a fact to the database: `T` if it was new, or the fact that it replaces as the value of a property. Does nothing
    /// and gives `:locked` if the table `locks` has entries.
    AssertFact = internal "%ASSERT" ("fact locks");
    /// Removes a fact from the database; whether it was there, or 0 for a pattern with variables. Does nothing and gives
    /// `:locked` if the table `locks` has entries.
    RetractFact = internal "%RETRACT" ("fact locks");
    /// From now on the last of `width` arguments of facts of this name is unique for given others; `NIL` if there are rules
    /// for such facts.
    MakeProperty = internal "%MAKE-PROPERTY" ("name width");
    /// The last argument of the fact that begins with the terms of a list, and whether there is one. For properties.
    PropertyValue = internal "%PROPERTY-VALUE" ("property");
    /// Adds a rule, unless one with an equal source is there, which it replaces.
    DefineRule = internal "%DEFINE-RULE" ("head body source");
    /// Begins a query in which variables have the values of an association list, and does its first step: the first answers;
    /// the number of the query, or `NIL` if these were all; and whether all answers are found.
    BeginQuery = internal "%BEGIN-QUERY" ("query bindings");
    /// Begins a query in which variables have the values of an association list; the number that names it. With `facts`,
    /// its answers are the facts that match a pattern.
    OpenQuery = internal "%OPEN-QUERY" ("query bindings facts");
    /// Works on a query: `T` when all answers are found, `NIL` when there is more to do; or `:test`, a function whose value
    /// is to be told, and the bindings under which to call it.
    QueryStep = internal "%QUERY-STEP" ("query");
    /// Tells a query the outcome of the test that it has asked for.
    QueryTell = internal "%QUERY-TELL" ("query holds");
    /// The next answers of a query, a list of binding lists; empty when all were given.
    QueryAnswers = internal "%QUERY-ANSWERS" ("query");
    /// Removes the next fact that a query has found and that is still there, and gives it; `NIL` when all were seen to, `T` to be
    /// asked again. Does nothing and gives `:locked` if the table `locks` has entries.
    RetractNext = internal "%RETRACT-NEXT" ("query locks");
    /// Ends a query.
    CloseQuery = internal "%CLOSE-QUERY" ("query");

    // ---- the host
    /// The arguments of the program, a list of strings.
    CommandLineArguments = esl "COMMAND-LINE-ARGUMENTS" ("");
    /// Seconds on the machine's clock, which never goes back.
    Now = esl "NOW" ("");
    /// Microseconds on the machine's clock, which never goes back.
    InternalRealTime = cl "GET-INTERNAL-REAL-TIME" ("");
    /// Seconds since the beginning of 1900, UTC.
    UniversalTime = cl "GET-UNIVERSAL-TIME" ("");

    // ---- events
    /// A new event. The name is for reports.
    MakeEvent = esl "MAKE-EVENT" ("&optional name");
    /// Signals an event: all tasks that wait for it go on, in the order in which they began to, and get the arguments.
    Signal = esl "SIGNAL" ("event &rest arguments");
    /// The same as `signal`.
    SignalEvent = esl "SIGNAL-EVENT" ("event &rest arguments");
    /// How often an event was signalled.
    EventCount = esl "EVENT-COUNT" ("event");
    /// The sum of the counts of an event, or of a list of events.
    CountEvents = internal "%COUNT-EVENTS" ("events");
    /// The name of an event or task, or `NIL`.
    EventName = internal "%EVENT-NAME" ("event");
    /// Whether `object` is an event; tasks are.
    Eventp = internal "%EVENTP" ("object");
    /// The event that every signal of any event signals too, without arguments.
    AnyEvent = internal "%ANY-EVENT" ("");
    /// Waits until one of `events`, an event or a list of events, is signalled, and returns the arguments of the signal as
    /// values. The options are `[test] &key timeout unless-count`: with `test`, waits until a signal whose arguments answer true to
    /// it; it runs in this task, and no signal is lost meanwhile. Fails with `:timeout` after `timeout` seconds. Does not wait,
    /// and returns `NIL`, if the sum of the counts of `events` is no longer `unless-count`.
    WaitForEvents = esl "WAIT-FOR-EVENTS" ("events &rest options") slowly "%SLOW-WAIT-FOR-EVENTS";
    /// The same as `wait-for-events`.
    WaitForEvent = esl "WAIT-FOR-EVENT" ("events &rest options") slowly "%SLOW-WAIT-FOR-EVENT";
    /// Waits for the next signal of one of `events` and returns its arguments; returns at once if `count` is not `NIL`
    /// and no longer the sum of their counts. `what` is for reports.
    Wait = internal "%WAIT" ("events count what");
    /// A wait that keeps all signals of `events` until it is closed, and lasts for `seconds` if they are not `NIL`; `NIL`
    /// if `count` is not `NIL` and no longer the sum of their counts.
    OpenWait = internal "%OPEN-WAIT" ("events seconds count what");
    /// Waits for a signal that a wait has kept: the list of its arguments, or `:timeout`.
    TakeSignal = internal "%TAKE-SIGNAL" ("wait");
    /// Ends a wait.
    CloseWait = internal "%CLOSE-WAIT" ("wait");
    /// The time in so many seconds, in nanoseconds.
    Deadline = internal "%DEADLINE" ("seconds");
    /// Waits until a time in nanoseconds.
    SleepUntil = internal "%SLEEP-UNTIL" ("deadline");
    /// Lets other tasks have their turns.
    PassTurn = internal "%PASS-TURN" ("");

    // ---- tasks
    /// A new task that calls a function. `daemon` may be `:internal` for one that is not listed. `notify` is a guard that
    /// is told of its end.
    Spawn = internal "%SPAWN" ("function &optional name priority budget daemon notify");
    /// New tasks, one for each function and name, that begin together: a net, and the tasks. They have the priority of this
    /// task. `what` is for reports.
    SpawnNet = internal "%SPAWN-NET" ("what names &rest functions");
    /// Waits until a task of a net has ended with `status`, and returns the first that has; or until all have ended, and
    /// returns `NIL`.
    AwaitNet = internal "%AWAIT-NET" ("net status");
    /// Ends the tasks of a net that are left, and waits for that. The net may be `NIL`.
    EndNet = internal "%END-NET" ("net") slowly "%SLOW-END-NET";
    /// The task that runs.
    CurrentTask = esl "CURRENT-TASK" ("");
    /// Whether `object` is a task.
    Taskp = internal "%TASKP" ("object");
    /// `:running`, `:waiting`, `:succeeded`, `:failed` or `:aborted`.
    TaskStatus = esl "TASK-STATUS" ("task");
    /// The number of a task, and that of the task that made it; `NIL` when it has ended.
    TaskNumber = internal "%TASK-NUMBER" ("task");
    /// The ticks that a task has used; `NIL` when it has ended.
    TaskTicks = internal "%TASK-TICKS" ("task");
    /// The status of a task that has ended, then its values, or the condition; `NIL` before.
    TaskEnd = internal "%TASK-END" ("task");
    /// The first value of a task that has returned; `NIL` of another.
    TaskValue = internal "%TASK-VALUE" ("task");
    /// The tasks that have not ended, oldest first; with those that are not listed if `hidden`.
    AllTasks = internal "%ALL-TASKS" ("hidden") slowly "%SLOW-ALL-TASKS";
    /// Some of these tasks, in no order, from a number on; and the number for the next ones, `NIL` if there are no more.
    TasksFrom = internal "%TASKS-FROM" ("place hidden");
    /// Waits for the end of a task, then as `%task-end`. With `child`, the time of a cleanup does not count.
    Join = internal "%JOIN" ("task child");
    /// Asks for the end of a task.
    RequestAbort = internal "%REQUEST-ABORT" ("task");
    /// Ends a task wherever it is, and returns when its cleanups are over.
    AbortTask = esl "ABORT-TASK" ("task");
    /// Notes a checkpoint of the running task, and signals it.
    AddCheckpoint = internal "%ADD-CHECKPOINT" ("id");
    /// The checkpoints that a task has passed, newest first.
    Checkpoints = internal "%CHECKPOINTS" ("task");
    /// What lets the end of another task interrupt this one with a call of `function`.
    MakeGuard = internal "%MAKE-GUARD" ("function");
    /// Has a guard interrupt its task, again if it has done so before.
    InterruptBy = internal "%INTERRUPT-BY" ("guard");
    /// Lets a guard interrupt no more.
    CloseGuard = internal "%CLOSE-GUARD" ("guard");
    /// Makes the innermost catch, for `tag`, a limit: when it expires, its form is ended and gives the cause.
    OpenLimit = internal "%OPEN-LIMIT" ("tag seconds ticks");
    /// Begins a critical section: no other task runs.
    BeginCritical = internal "%BEGIN-CRITICAL" ("");
    /// Ends a critical section.
    EndCritical = internal "%END-CRITICAL" ("");
}
