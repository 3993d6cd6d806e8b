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

    // ---- structures
    /// Slot `index` of `instance`, which must be an instance of the class named `class` or a subclass.
    SlotOf = internal "%SLOT" ("class index instance");
    /// Makes `value` slot `index` of `instance`, and returns `value`.
    SetSlotOf = internal "%SET-SLOT" ("class index instance value");
    /// Whether `object` is an instance of the structure class named `class` or a subclass.
    IsInstance = internal "%INSTANCE-P" ("class object");

    // ---- failures and the control stack
    /// How many entries the control stack has.
    ControlHeight = internal "%CONTROL-HEIGHT" ("");
    /// The innermost handlers below `height` that no mask hides: index of the entry, whether it is one of cases, and its
    /// types, or its list of `(type . function)`. `NIL` if there are none.
    NextHandler = internal "%NEXT-HANDLER" ("height");
    /// Unwinds to the entry with this index, of the cases of a `handler-case`, and has one of them take the condition.
    TakeCase = internal "%TAKE-CASE" ("index case condition");
    /// Ends the running task as failed, with this condition.
    EndTask = internal "%END-TASK" ("condition");
    /// Ends the run with this status, from 0 to 255. The remaining tasks are aborted.
    Exit = internal "%EXIT" ("status");
    /// The innermost `limit` frames, each a list of the function's name, and source, line and column if known.
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
    Get = cl "GET" ("symbol indicator &optional default") slowly "SLOW-GET";
    /// Makes `value` the property `indicator` of `symbol`, and returns it.
    Put = internal "%PUT" ("symbol indicator value") slowly "SLOW-PUT";
    /// Removes the property `indicator` of `symbol`; whether it had one.
    Remprop = cl "REMPROP" ("symbol indicator") slowly "SLOW-REMPROP";
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
    /// A handle of a text that is compiled form by form.
    OpenText = internal "%OPEN-TEXT" ("text");
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
    MakeStringInput = internal "%MAKE-STRING-INPUT" ("string start end");
    /// How many characters of its string such a stream has read.
    StringInputPosition = internal "%STRING-INPUT-POSITION" ("stream");
    /// A stream that gathers what is written to it.
    MakeStringOutput = internal "%MAKE-STRING-OUTPUT" ("");
    /// What a string stream has gathered since this was last asked.
    GetOutputStreamString = cl "GET-OUTPUT-STREAM-STRING" ("stream");
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
    PeekChar = cl "PEEK-CHAR" ("&optional peek-type stream eof-error-p eof-value recursive-p") slowly "SLOW-PEEK-CHAR";
    /// Puts the character that was read last back into a stream.
    UnreadChar = cl "UNREAD-CHAR" ("character &optional stream");
    /// The next line of a stream, and whether it has no line end. Waits for standard input.
    ReadLine = cl "READ-LINE" ("&optional stream eof-error-p eof-value recursive-p");
    /// Writes a character to a stream, and returns it.
    WriteChar = cl "WRITE-CHAR" ("character &optional stream");
    /// Writes a part of a string to a stream, and returns the string.
    WriteStringPart = internal "%WRITE-STRING" ("string stream start end");
    /// Ends the line that is being written to a stream.
    Terpri = cl "TERPRI" ("&optional stream");
    /// Ends the line that is being written to a stream, unless it is empty; whether it did.
    FreshLine = cl "FRESH-LINE" ("&optional stream");
    /// Writes what a stream has gathered.
    FinishOutput = cl "FINISH-OUTPUT" ("&optional stream");
    /// Writes what a stream has gathered.
    ForceOutput = cl "FORCE-OUTPUT" ("&optional stream");
}
