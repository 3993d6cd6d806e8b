//! A compile-time host without a virtual machine: macros are Rust functions on data, modules are only
//! counted.

use std::collections::HashMap;

use esl_bytecode::compile::{
    Accessor, Arity, CompileTimeFailure, CompileTimeHost, Environment, Global, GlobalFunction,
    GlobalVariable, InternError, MacroCall, MacroRef, NameUse, SlotAccess, SourcePlace,
};
use esl_bytecode::datum::{Datum, ObjectId};
use esl_bytecode::module::{Constant, Module};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_compiler::reader::{BareEnvironment, read_datum};

/// A macro: takes the form and its arguments in a row, gives the expansion or the text of a failure.
pub(crate) type Macro = Box<dyn FnMut(&mut BareEnvironment, &[Datum]) -> Result<Datum, String> + Send>;

/// The host.
pub(crate) struct FakeHost {
    pub(crate) bare: BareEnvironment,
    pub(crate) globals: HashMap<Symbol, Global>,
    pub(crate) setf_functions: Vec<Symbol>,
    pub(crate) properties: HashMap<(Symbol, Symbol), Datum>,
    pub(crate) macros: HashMap<Symbol, Macro>,
    /// The functions of local macros, in the order in which they will be loaded.
    pub(crate) local_macros: Vec<Macro>,
    objects: usize,
    /// The place at which macros fail.
    pub(crate) failing_place: Option<SourcePlace>,
    /// The loaded modules: whether each is to be kept, and the symbols among its constants.
    pub(crate) loaded: Vec<(bool, String)>,
}

impl FakeHost {
    pub(crate) fn new() -> FakeHost {
        let mut host = FakeHost {
            bare: BareEnvironment::new(),
            globals: HashMap::new(),
            setf_functions: Vec::new(),
            properties: HashMap::new(),
            macros: HashMap::new(),
            local_macros: Vec::new(),
            objects: 0,
            failing_place: None,
            loaded: Vec::new(),
        };
        host.define_macro("when", "(if #1 (progn . #2...))");
        host.define_macro("dolist", "(block nil (let ((rest nil)) (tagbody again . #2...)))");
        host.define_macro("twice", "(progn #1 #1)");
        host.define_macro("endless", "(endless)");
        host.define_macro("wrong", "(let 5)");
        host.define_macro("first-of", "(car #1)");
        let failing = host.symbol("failing");
        host.globals.entry(failing.clone()).or_default().function = GlobalFunction::Macro;
        host.macros.insert(failing, Box::new(|_, _| Err("it did not work".into())));
        host.function("f", 1, Some(1));
        host.function("g", 0, None);
        host.function("getf", 2, Some(3));
        for name in
            ["nthcdr", "dpb", "ldb", "replace", "subseq", "adjoin", "gethash", "print", "find-package"]
        {
            host.function(name, 0, None);
        }
        for name in
            ["esl::%putf", "esl::%remf", "esl::%check-arguments", "esl::%check-keys", "esl::%key-tail"]
        {
            host.function(name, 0, None);
        }
        for name in ["*x*", "*y*", "*package*"] {
            let symbol = host.symbol(name);
            host.globals.entry(symbol).or_default().variable = GlobalVariable::Special;
        }
        let pi = Datum::integer(3, Span::default());
        let limit = host.symbol("limit");
        host.globals.entry(limit).or_default().variable = GlobalVariable::Constant(pi);
        let accessor = Accessor { class: host.symbol("point"), slot: 1, access: SlotAccess::Free };
        let point_y = host.symbol("point-y");
        host.function("point-y", 1, Some(1));
        host.globals.entry(point_y).or_default().accessor = Some(accessor);
        let fixed = Accessor { class: host.symbol("point"), slot: 0, access: SlotAccess::ReadOnly };
        let point_x = host.symbol("point-x");
        host.globals.entry(point_x).or_default().accessor = Some(fixed);
        for (name, template) in [("improvable", "(f #1)"), ("good-enough", "#0")] {
            host.function(name, 0, None);
            host.record(name, "esl::%compiler-macro", &format!("better-{name}"));
            host.define_macro(&format!("better-{name}"), template);
        }
        host.record("short", "esl::%setf", "f");
        host.record("short-macro", "esl::%setf", "twice");
        host.record("long", "esl::%setf", "(write-long 1)");
        host.define_macro("write-long", "(g #2 (car '#1))");
        host.record("five", "esl::%setf", "(:expander expand-five)");
        host.define_macro("expand-five", "((a) (#1) (new) (g new a) (f a))");
        let open = host.symbol("open-file");
        host.globals.entry(open).or_default().instead = Some("use `with-input-from-string`".into());
        host
    }

    /// A host in which `car` belongs to the language.
    pub(crate) fn locked() -> FakeHost {
        let mut host = FakeHost::new();
        host.globals.entry(Symbol::cl("CAR")).or_default().locked = true;
        host
    }

    pub(crate) fn read(&mut self, text: &str) -> Datum {
        let (datum, _) = read_datum(&mut self.bare, text, 0).expect("the text reads");
        without_spans(&datum.expect("there is a datum"))
    }

    pub(crate) fn symbol(&mut self, name: &str) -> Symbol {
        self.read(name).as_symbol().expect("a symbol").clone()
    }

    pub(crate) fn function(&mut self, name: &str, min: u32, max: Option<u32>) {
        let symbol = self.symbol(name);
        self.globals.entry(symbol).or_default().function = GlobalFunction::Function(Some(Arity { min, max }));
    }

    pub(crate) fn record(&mut self, symbol: &str, indicator: &str, value: &str) {
        let key = (self.symbol(symbol), self.symbol(indicator));
        let value = self.read(value);
        self.properties.insert(key, value);
    }

    /// A macro by template: `#0` stands for the form, `#1` for the first argument, `(… . #2...)` for those
    /// from the second on.
    pub(crate) fn define_macro(&mut self, name: &str, template: &str) {
        let symbol = self.symbol(name);
        self.globals.entry(symbol.clone()).or_default().function = GlobalFunction::Macro;
        let expander = self.template(template);
        self.macros.insert(symbol, expander);
    }

    pub(crate) fn template(&mut self, template: &str) -> Macro {
        let template = self.read(&template.replace('#', "argument-"));
        Box::new(move |_, args| Ok(fill(&template, args)))
    }
}

/// Returns the datum as a program makes it: without places in the source.
pub(crate) fn without_spans(datum: &Datum) -> Datum {
    use esl_bytecode::datum::DatumKind;
    let none = Span::default();
    match datum.kind() {
        DatumKind::Cons(car, cdr) => Datum::cons(without_spans(car), without_spans(cdr), none),
        kind => Datum::new(kind.clone(), none),
    }
}

fn fill(template: &Datum, args: &[Datum]) -> Datum {
    if let Some(symbol) = template.as_symbol()
        && let Some(number) = symbol.name().strip_prefix("ARGUMENT-")
    {
        return match number.strip_suffix("...") {
            Some(number) => {
                let from = number.parse::<usize>().expect("a number");
                Datum::list(args.get(from..).unwrap_or_default().to_vec(), Span::default())
            }
            None => {
                let index = number.parse::<usize>().expect("a number");
                args.get(index).cloned().unwrap_or_else(|| Datum::nil(Span::default()))
            }
        };
    }
    match template.as_cons() {
        Some((car, cdr)) => Datum::cons(fill(car, args), fill(cdr, args), Span::default()),
        None => template.clone(),
    }
}

impl Environment for FakeHost {
    fn global(&self, symbol: &Symbol) -> Global {
        self.globals.get(symbol).cloned().unwrap_or_default()
    }

    fn setf_function(&self, symbol: &Symbol) -> GlobalFunction {
        let is_defined = self.setf_functions.contains(symbol);
        if is_defined { GlobalFunction::Function(None) } else { GlobalFunction::Undefined }
    }

    fn property(&self, symbol: &Symbol, indicator: &Symbol) -> Option<Datum> {
        self.properties.get(&(symbol.clone(), indicator.clone())).cloned()
    }

    fn intern(&mut self, package: Option<&str>, name: &str, internal: bool) -> Result<Symbol, InternError> {
        self.bare.intern(package, name, internal)
    }

    fn fresh(&mut self) -> u32 {
        self.bare.fresh()
    }

    fn similar(&self, symbol: &Symbol, wanted: NameUse) -> Vec<Symbol> {
        let is_like = |other: &&Symbol| {
            let global = &self.globals[*other];
            let is_defined = match wanted {
                NameUse::Variable => !matches!(global.variable, GlobalVariable::Undefined),
                NameUse::Function => global.function != GlobalFunction::Undefined,
                NameUse::Cause | NameUse::Type => false,
            };
            is_defined && *other != symbol && other.name().get(..2) == symbol.name().get(..2)
        };
        let mut similar: Vec<Symbol> = self.globals.keys().filter(is_like).cloned().collect();
        similar.sort_by(|a, b| a.name().cmp(b.name()));
        similar
    }
}

impl FakeHost {
    /// The failure of a macro: at `failing_place`, and about the first argument.
    fn failure(&self, report: String, args: &[Datum]) -> CompileTimeFailure {
        let culprits = args.get(1).cloned().into_iter().collect();
        CompileTimeFailure { report, place: self.failing_place.clone(), culprits, usage: None }
    }
}

impl CompileTimeHost for FakeHost {
    fn expand(&mut self, call: &MacroCall) -> Result<Datum, CompileTimeFailure> {
        let items = call.form.as_list().ok_or("no list".to_string())?;
        let mut args: Vec<Datum> = items.into_iter().cloned().collect();
        args[0] = call.form.clone();
        let expander = match &call.function {
            MacroRef::Global(symbol) => self.macros.get_mut(symbol),
            MacroRef::Local(ObjectId(number)) => self.local_macros.get_mut(*number as usize),
        };
        let expander = expander.ok_or("there is no such macro".to_string())?;
        let expansion = expander(&mut self.bare, &args);
        expansion.map_err(|report| self.failure(report, &args))
    }

    fn load(&mut self, module: Module, keep: bool) -> Result<Option<ObjectId>, CompileTimeFailure> {
        let symbols = module.constants.iter().filter_map(|constant| match constant {
            Constant::Symbol(symbol) => Some(symbol.name().to_lowercase()),
            _ => None,
        });
        let symbols: Vec<String> = symbols.collect();
        // Stands in for the functions that make definitions.
        self.loaded.push((keep, symbols.join(" ")));
        if keep {
            self.objects += 1;
            return Ok(Some(ObjectId(self.objects as u32 - 1)));
        }
        Ok(None)
    }
}
