//! A notation for core trees, so that tests can be read: Lisp, as far as it needs no macros.
//!
//! Names between stars are special variables, `(special x)` in a lambda list makes a special parameter; names
//! that are not bound are special variables as well. A call of a name that is neither bound nor a builtin is
//! a global call.

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use crate::core::*;

/// Reads one datum; upper case is up to the writer.
pub(super) fn read(text: &str) -> Datum {
    let mut reader = Reader { text: text.as_bytes(), at: 0 };
    let datum = reader.datum();
    reader.blanks();
    assert_eq!(reader.at, text.len(), "one datum");
    datum
}

struct Reader<'a> {
    text: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn blanks(&mut self) {
        while self.text.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
    }

    fn datum(&mut self) -> Datum {
        self.blanks();
        let start = self.at;
        let byte = self.text[self.at];
        if byte == b'(' {
            self.at += 1;
            let mut items = Vec::new();
            loop {
                self.blanks();
                if self.text[self.at] == b')' {
                    self.at += 1;
                    return Datum::list(items, self.span(start));
                }
                items.push(self.datum());
            }
        }
        if byte == b'\'' {
            self.at += 1;
            let quoted = self.datum();
            let quote = Datum::symbol(Symbol::cl("QUOTE"), self.span(start));
            return Datum::list([quote, quoted], self.span(start));
        }
        if byte == b'"' {
            let end =
                start + 1 + self.text[start + 1..].iter().position(|&b| b == b'"').expect("a closing quote");
            self.at = end + 1;
            let string = std::str::from_utf8(&self.text[start + 1..end]).expect("text");
            return Datum::string(string, self.span(start));
        }
        while self.text.get(self.at).is_some_and(|b| !b.is_ascii_whitespace() && !b"()'".contains(b)) {
            self.at += 1;
        }
        let token = std::str::from_utf8(&self.text[start..self.at]).expect("text");
        let span = self.span(start);
        if let Ok(integer) = token.parse::<i64>() {
            return Datum::integer(integer, span);
        }
        if let Ok(float) = token.parse::<f64>()
            && token.contains('.')
        {
            return Datum::new(DatumKind::Float(float), span);
        }
        let symbol = match token.strip_prefix(':') {
            Some(keyword) => Symbol::keyword(&keyword.to_uppercase()),
            None => name(token),
        };
        Datum::symbol(symbol, span)
    }

    fn span(&self, start: usize) -> Span {
        Span::new(SourceId(0), start as u32, self.at as u32)
    }
}

/// A symbol: builtins and the constants are at home where the table says, all others in `COMMON-LISP` for
/// brevity.
fn name(token: &str) -> Symbol {
    let upper = token.to_uppercase();
    match BUILTINS.iter().find(|info| info.name == upper) {
        Some(info) => Symbol::new(&info.package().into(), &upper),
        None => Symbol::cl(&upper),
    }
}

/// The core tree of one form.
pub(super) fn core(text: &str) -> Core {
    core_of(&read(text))
}

/// The same, for deep forms: the notation itself recurses.
pub(super) fn core_in_big_stack(text: &str) -> Core {
    stacker::grow(256 << 20, || core(text))
}

/// The core tree of a datum in the notation.
fn core_of(datum: &Datum) -> Core {
    let mut builder = CoreBuilder { core: Core::default(), scopes: Vec::new(), lambda: LambdaId(0) };
    let hole = builder.node(NodeKind::Hole, datum.span());
    builder.core.lambdas.push(Lambda {
        name: None,
        lambda_list: None,
        documentation: None,
        parent: None,
        span: datum.span(),
        required: Vec::new(),
        optional: Vec::new(),
        rest: None,
        keys: None,
        allow_other_keys: false,
        body: hole,
    });
    builder.fill(hole, datum);
    builder.core
}

#[derive(Clone)]
enum Meaning {
    Variable(VarId),
    Function(VarId),
    Block(BlockId),
    Tag(TagbodyId, u32),
}

struct CoreBuilder {
    core: Core,
    scopes: Vec<FxHashMap<(u8, Symbol), Meaning>>,
    lambda: LambdaId,
}

const VARIABLE: u8 = 0;
const FUNCTION: u8 = 1;
const BLOCK: u8 = 2;
const TAG: u8 = 3;

impl CoreBuilder {
    fn node(&mut self, kind: NodeKind, span: Span) -> NodeId {
        self.core.nodes.push(Node { kind, span });
        NodeId(self.core.nodes.len() as u32 - 1)
    }

    fn lookup(&self, space: u8, symbol: &Symbol) -> Option<Meaning> {
        self.scopes.iter().rev().find_map(|scope| scope.get(&(space, symbol.clone())).cloned())
    }

    fn bind(&mut self, space: u8, symbol: &Symbol, meaning: Meaning) {
        self.scopes.last_mut().expect("a scope").insert((space, symbol.clone()), meaning);
    }

    fn variable(&mut self, symbol: &Symbol, span: Span) -> VarId {
        let owner = self.lambda;
        let name = symbol.clone();
        let variable = Variable {
            name,
            span,
            owner,
            is_assigned: false,
            is_captured: false,
            is_read: false,
            never_returns: false,
        };
        self.core.variables.push(variable);
        VarId(self.core.variables.len() as u32 - 1)
    }

    fn form(&mut self, datum: &Datum) -> NodeId {
        let node = self.node(NodeKind::Hole, datum.span());
        self.fill(node, datum);
        node
    }

    fn forms(&mut self, data: &[Datum]) -> Vec<NodeId> {
        data.iter().map(|datum| self.form(datum)).collect()
    }

    fn body(&mut self, data: &[Datum], span: Span) -> NodeId {
        if let [form] = data {
            return self.form(form);
        }
        let node = self.node(NodeKind::Hole, span);
        let forms = self.forms(data);
        self.core.nodes[node.index()].kind = NodeKind::Progn(forms);
        node
    }

    fn fill(&mut self, node: NodeId, datum: &Datum) {
        let kind = self.kind(datum);
        self.core.nodes[node.index()].kind = kind;
    }

    fn kind(&mut self, datum: &Datum) -> NodeKind {
        match datum.kind() {
            DatumKind::Symbol(symbol) if symbol.is_keyword() || symbol.is_cl("T") => {
                NodeKind::Constant(datum.clone())
            }
            DatumKind::Symbol(symbol) => match self.lookup(VARIABLE, symbol) {
                Some(Meaning::Variable(variable)) => NodeKind::Local(variable),
                _ => NodeKind::Special(symbol.clone()),
            },
            DatumKind::Cons(..) => {
                let items: Vec<Datum> = datum.elements().cloned().collect();
                self.compound(&items, datum.span())
            }
            _ => NodeKind::Constant(datum.clone()),
        }
    }

    fn compound(&mut self, items: &[Datum], span: Span) -> NodeKind {
        let (head, rest) = items.split_first().expect("a form");
        let Some(operator) = head.as_symbol().cloned() else {
            let function = self.form(head);
            return NodeKind::Call(Callee::Value(function), self.forms(rest));
        };
        if let Some(Meaning::Function(function)) = self.lookup(FUNCTION, &operator) {
            return NodeKind::Call(Callee::Local(function), self.forms(rest));
        }
        match operator.name() {
            "QUOTE" => NodeKind::Constant(rest[0].clone()),
            "SETQ" => {
                let value = self.form(&rest[1]);
                let symbol = symbol_of(&rest[0]);
                match self.lookup(VARIABLE, &symbol) {
                    Some(Meaning::Variable(variable)) => NodeKind::SetLocal(variable, value),
                    _ => NodeKind::SetSpecial(symbol, value),
                }
            }
            "IF" => {
                let test = self.form(&rest[0]);
                let consequent = self.form(&rest[1]);
                let nil = Datum::nil(span);
                NodeKind::If(test, consequent, self.form(rest.get(2).unwrap_or(&nil)))
            }
            "PROGN" => NodeKind::Progn(self.forms(rest)),
            "AND" => NodeKind::And(self.forms(rest)),
            "OR" => NodeKind::Or(self.forms(rest)),
            "LET" | "LET*" => self.let_form(operator.name() == "LET*", rest, span),
            "FLET" | "LABELS" => self.functions(operator.name() == "LABELS", rest, span),
            "LAMBDA" => NodeKind::Lambda(self.lambda(None, &rest[0], &rest[1..], span)),
            "FUNCTION" => self.function(&rest[0]),
            "DEFUN" => {
                let lambda = self.node(NodeKind::Hole, span);
                let id = self.lambda(Some(rest[0].clone()), &rest[1], &rest[2..], span);
                self.core.nodes[lambda.index()].kind = NodeKind::Lambda(id);
                let name = self.node(NodeKind::Constant(rest[0].clone()), span);
                NodeKind::Call(
                    Callee::Builtin(esl_bytecode::builtin::Builtin::SetFunction),
                    vec![name, lambda],
                )
            }
            "BLOCK" => {
                let symbol = block_name(&rest[0]);
                let (owner, name) = (self.lambda, Some(symbol.clone()));
                self.core.blocks.push(Block { name, owner, is_captured: false, is_used: true });
                let block = BlockId(self.core.blocks.len() as u32 - 1);
                self.scopes.push(FxHashMap::default());
                self.bind(BLOCK, &symbol, Meaning::Block(block));
                let body = self.body(&rest[1..], span);
                self.scopes.pop();
                NodeKind::Block(block, body)
            }
            "RETURN-FROM" => {
                let Some(Meaning::Block(block)) = self.lookup(BLOCK, &block_name(&rest[0])) else {
                    panic!("no block {}", rest[0]);
                };
                let nil = Datum::nil(span);
                NodeKind::ReturnFrom(block, self.form(rest.get(1).unwrap_or(&nil)))
            }
            "TAGBODY" => self.tagbody(rest),
            "GO" => match self.lookup(TAG, &symbol_of(&rest[0])) {
                Some(Meaning::Tag(tagbody, tag)) => NodeKind::Go(tagbody, tag),
                _ => panic!("no tag {}", rest[0]),
            },
            "CATCH" => NodeKind::Catch(self.form(&rest[0]), self.body(&rest[1..], span)),
            "THROW" => NodeKind::Throw(self.form(&rest[0]), self.form(&rest[1])),
            "UNWIND-PROTECT" => NodeKind::UnwindProtect(self.form(&rest[0]), self.body(&rest[1..], span)),
            "PROGV" => NodeKind::Progv(self.form(&rest[0]), self.form(&rest[1]), self.body(&rest[2..], span)),
            "HANDLERS" => NodeKind::Handlers(self.form(&rest[0]), self.body(&rest[1..], span)),
            "MASK" => NodeKind::Mask(self.form(&rest[0]), self.body(&rest[1..], span)),
            "HANDLER-CASE" => self.handler_case(rest, span),
            "FUNCALL" if rest.len() > 1 || !rest.is_empty() => {
                NodeKind::Call(Callee::Value(self.form(&rest[0])), self.forms(&rest[1..]))
            }
            "APPLY" => NodeKind::Apply(Callee::Value(self.form(&rest[0])), self.forms(&rest[1..])),
            "VALUES" => NodeKind::Values(self.forms(rest)),
            "MULTIPLE-VALUE-BIND" => {
                let form = self.form(&rest[1]);
                self.scopes.push(FxHashMap::default());
                let targets = rest[0].elements().map(|name| self.target(name)).collect();
                let body = self.body(&rest[2..], span);
                self.scopes.pop();
                NodeKind::BindValues(targets, form, body)
            }
            "MULTIPLE-VALUE-CALL" => NodeKind::CallValues(self.form(&rest[0]), self.forms(&rest[1..])),
            "MULTIPLE-VALUE-PROG1" => NodeKind::FirstValues(self.form(&rest[0]), self.body(&rest[1..], span)),
            "SLOT" => NodeKind::Slot(symbol_of(&rest[0]), number_of(&rest[1]), self.form(&rest[2])),
            "SET-SLOT" => {
                let (instance, value) = (self.form(&rest[2]), self.form(&rest[3]));
                NodeKind::SetSlot(symbol_of(&rest[0]), number_of(&rest[1]), instance, value)
            }
            "IS-A" => NodeKind::IsInstance(symbol_of(&rest[0]), self.form(&rest[1])),
            name => {
                let builtin = BUILTINS.iter().find(|info| info.name == name).map(|info| info.builtin);
                let callee = builtin.map_or(Callee::Global(operator.clone()), Callee::Builtin);
                NodeKind::Call(callee, self.forms(rest))
            }
        }
    }

    fn target(&mut self, datum: &Datum) -> BoundVariable {
        let symbol = symbol_of(datum);
        if symbol.name().starts_with('*') {
            return BoundVariable::Special(symbol);
        }
        let variable = self.variable(&symbol, datum.span());
        self.bind(VARIABLE, &symbol, Meaning::Variable(variable));
        BoundVariable::Lexical(variable)
    }

    fn let_form(&mut self, sequential: bool, rest: &[Datum], span: Span) -> NodeKind {
        let mut values = Vec::new();
        let mut bindings = Vec::new();
        self.scopes.push(FxHashMap::default());
        for binding in rest[0].elements() {
            let parts: Vec<Datum> = binding.elements().cloned().collect();
            let value = self.form(&parts[1]);
            if sequential {
                bindings.push((self.target(&parts[0]), value));
            } else {
                values.push((parts[0].clone(), value));
            }
        }
        for (name, value) in values {
            bindings.push((self.target(&name), value));
        }
        let body = self.body(&rest[1..], span);
        self.scopes.pop();
        NodeKind::Let { sequential, bindings, body }
    }

    fn functions(&mut self, recursive: bool, rest: &[Datum], span: Span) -> NodeKind {
        let parts: Vec<Vec<Datum>> =
            rest[0].elements().map(|function| function.elements().cloned().collect()).collect();
        let names: Vec<VarId> =
            parts.iter().map(|part| self.variable(&symbol_of(&part[0]), part[0].span())).collect();
        let bind = |builder: &mut CoreBuilder| {
            builder.scopes.push(FxHashMap::default());
            for (part, &name) in parts.iter().zip(&names) {
                builder.bind(FUNCTION, &symbol_of(&part[0]), Meaning::Function(name));
            }
        };
        if recursive {
            bind(self);
        }
        let lambdas: Vec<LambdaId> = parts
            .iter()
            .map(|part| {
                let flet = Datum::symbol(Symbol::cl(if recursive { "LABELS" } else { "FLET" }), span);
                let name = Datum::list([flet, part[0].clone()], span);
                self.lambda(Some(name), &part[1], &part[2..], span)
            })
            .collect();
        if !recursive {
            bind(self);
        }
        let body = self.body(&rest[1..], span);
        self.scopes.pop();
        NodeKind::Functions { definitions: names.into_iter().zip(lambdas).collect(), body }
    }

    fn function(&mut self, datum: &Datum) -> NodeKind {
        let Some(symbol) = datum.as_symbol() else { return self.kind(datum) };
        if let Some(Meaning::Function(function)) = self.lookup(FUNCTION, symbol) {
            return NodeKind::Local(function);
        }
        match BUILTINS.iter().find(|info| info.name == symbol.name()) {
            Some(info) => NodeKind::BuiltinRef(info.builtin),
            None => NodeKind::FunctionRef(symbol.clone()),
        }
    }

    fn parameter(&mut self, datum: &Datum) -> Parameter {
        let (name, is_special) = match datum.as_cons() {
            Some((_, rest)) => (rest.as_cons().expect("(special name)").0.clone(), true),
            None => (datum.clone(), false),
        };
        let symbol = symbol_of(&name);
        let variable = self.variable(&symbol, name.span());
        if !is_special {
            self.bind(VARIABLE, &symbol, Meaning::Variable(variable));
        }
        Parameter { variable, is_special }
    }

    fn lambda(&mut self, name: Option<Datum>, list: &Datum, body: &[Datum], span: Span) -> LambdaId {
        let id = LambdaId(self.core.lambdas.len() as u32);
        let parent = std::mem::replace(&mut self.lambda, id);
        let placeholder = NodeId(0);
        self.core.lambdas.push(Lambda {
            name: name.clone(),
            lambda_list: Some(list.clone()),
            documentation: None,
            parent: Some(parent),
            span,
            required: Vec::new(),
            optional: Vec::new(),
            rest: None,
            keys: None,
            allow_other_keys: false,
            body: placeholder,
        });
        self.scopes.push(FxHashMap::default());
        let mut state = "";
        for item in list.elements() {
            if let Some(keyword) = item.as_symbol().filter(|symbol| symbol.name().starts_with('&')) {
                state = match keyword.name() {
                    "&OPTIONAL" => "optional",
                    "&REST" => "rest",
                    "&KEY" => {
                        self.core.lambdas[id.index()].keys = Some(Vec::new());
                        "key"
                    }
                    _ => {
                        self.core.lambdas[id.index()].allow_other_keys = true;
                        state
                    }
                };
                continue;
            }
            if state.is_empty() || state == "rest" {
                let parameter = self.parameter(item);
                let lambda = &mut self.core.lambdas[id.index()];
                if state == "rest" {
                    lambda.rest = Some(parameter);
                } else {
                    lambda.required.push(parameter);
                }
                continue;
            }
            let parts: Vec<Datum> = match item.as_cons() {
                Some(_) => item.elements().cloned().collect(),
                None => vec![item.clone()],
            };
            let default = self.form(parts.get(1).unwrap_or(&Datum::nil(span)));
            let parameter = self.parameter(&parts[0]);
            let supplied = parts.get(2).map(|flag| self.parameter(flag));
            let optional = OptionalParameter { parameter, default, supplied };
            let lambda = &mut self.core.lambdas[id.index()];
            match &mut lambda.keys {
                Some(keys) => {
                    let key = Symbol::keyword(symbol_of(&parts[0]).name());
                    keys.push(KeyParameter { key, optional });
                }
                None => lambda.optional.push(optional),
            }
        }
        let body = self.body(body, span);
        self.core.lambdas[id.index()].body = body;
        self.scopes.pop();
        self.lambda = parent;
        id
    }

    fn tagbody(&mut self, rest: &[Datum]) -> NodeKind {
        let owner = self.lambda;
        self.core.tagbodies.push(Tagbody { owner, is_captured: false });
        let tagbody = TagbodyId(self.core.tagbodies.len() as u32 - 1);
        self.scopes.push(FxHashMap::default());
        let tags = rest.iter().filter_map(Datum::as_symbol);
        for (number, tag) in tags.enumerate() {
            self.bind(TAG, tag, Meaning::Tag(tagbody, number as u32));
        }
        let items = rest.iter().map(|item| match item.as_symbol() {
            Some(_) => TagbodyItem::Tag,
            None => TagbodyItem::Form(self.form(item)),
        });
        let items = items.collect();
        self.scopes.pop();
        NodeKind::Tagbody(tagbody, items)
    }

    fn handler_case(&mut self, rest: &[Datum], span: Span) -> NodeKind {
        let body = self.form(&rest[0]);
        let mut clauses = Vec::new();
        for clause in &rest[1..] {
            let parts: Vec<Datum> = clause.elements().cloned().collect();
            self.scopes.push(FxHashMap::default());
            let name = parts[1].as_cons().map_or_else(|| Symbol::cl("IGNORED"), |(name, _)| symbol_of(name));
            let variable = self.variable(&name, span);
            self.bind(VARIABLE, &name, Meaning::Variable(variable));
            let body = self.body(&parts[2..], span);
            self.scopes.pop();
            clauses.push(HandlerClause { condition_type: parts[0].clone(), variable, body });
        }
        NodeKind::HandlerCase(body, clauses)
    }
}

fn symbol_of(datum: &Datum) -> Symbol {
    datum.as_symbol().cloned().unwrap_or_else(|| panic!("a symbol, not {datum}"))
}

fn block_name(datum: &Datum) -> Symbol {
    if datum.is_nil() { Symbol::cl("NIL") } else { symbol_of(datum) }
}

fn number_of(datum: &Datum) -> u16 {
    match datum.kind() {
        DatumKind::Integer(value) => u16::try_from(value).expect("a small number"),
        _ => panic!("a number, not {datum}"),
    }
}
