//! Functions of the host as rows: a name, the names of the parameters, a docstring, the rights that a call
//! needs, and code of Rust, whose types are those of the arguments and values.
//!
//! A row is the only declaration of its function. Rust gets the arguments by their types; ESL defines the
//! function from the row (`esl::%define-host-functions`).
//!
//! ```
//! use esl_host::{HostFailure, HostRows, Inbox};
//!
//! let mut rows = HostRows::new(&Inbox::new());
//! rows.at_once("%ADD", ["a", "b"], "Returns the sum of A and B.", |a: i64, b: i64| {
//!     a.checked_add(b).ok_or_else(|| HostFailure::new("OVERFLOW", "the sum is too large"))
//! });
//! assert_eq!(rows.iter().next().map(|row| row.parameters.join(" ")), Some("a b".into()));
//! ```

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;

use esl_bytecode::datum::Datum;

use super::argument::{ArgumentList, ArgumentReader};
use super::value::{HostHandle, HostObject, IntoDatum, IntoValues};
use super::{CallEffect, HostFailure, HostOperation, Inbox, Right};

/// Code of the host that takes and returns data, and cannot call back.
pub type DataFunction = Box<dyn FnMut(&[Datum]) -> Result<Datum, HostFailure> + Send>;

/// A function that the host gives to programs.
pub enum HostFunction {
    /// It returns at once.
    AtOnce(DataFunction),
    /// It begins an operation.
    Operation(Box<dyn FnMut(HostOperation) + Send>),
}

/// A right that a function of the host needs: to the text that is this argument of a call. The function is
/// given the permitted object in its place. An argument that is not a text needs none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Need {
    /// The right.
    pub right: Right,
    /// Index of the argument.
    pub argument: usize,
}

/// Values of an operation, or its failure.
pub type Completion = Result<Vec<Datum>, HostFailure>;

/// Future of an operation.
pub type OperationFuture = Pin<Box<dyn Future<Output = Completion> + Send>>;

/// Begins an operation whose work is a future: has that run, completes the operation, and decides what
/// cancelling does.
pub type BeginFuture = fn(HostOperation, OperationFuture);

/// A function of the host.
pub struct HostRow {
    /// Its name in ESL, in upper case.
    pub name: &'static str,
    /// Names of the parameters, in lower case.
    pub parameters: Vec<&'static str>,
    /// Docstring.
    pub documentation: &'static str,
    /// Rights that a call needs.
    pub needs: Vec<Need>,
    /// Whether it reaches nothing outside of the process, so that it is there in every world.
    pub is_everywhere: bool,
    /// The effect of a call made twice.
    pub effect: CallEffect,
    /// The code.
    pub function: HostFunction,
}

impl HostRow {
    /// Returns whether calls are operations, for which the calling task waits.
    pub fn waits(&self) -> bool {
        matches!(self.function, HostFunction::Operation(_))
    }

    /// Has calls need a right to the object that the argument of this parameter names.
    ///
    /// # Panics
    /// If there is no such parameter.
    pub fn needs(&mut self, right: Right, parameter: &str) -> &mut HostRow {
        let argument = self.parameters.iter().position(|known| *known == parameter);
        let argument = argument.expect("a right is needed for an argument of the function");
        self.needs.push(Need { right, argument });
        self
    }

    /// Has the function be there in every world: it reaches nothing outside of the process.
    pub fn everywhere(&mut self) -> &mut HostRow {
        self.is_everywhere = true;
        self.local()
    }

    /// Notes that a call reaches nothing outside of the process.
    pub fn local(&mut self) -> &mut HostRow {
        self.effect = CallEffect::Local;
        self
    }

    /// Notes that a call may be made twice: it only reads, or the second time changes nothing.
    pub fn idempotent(&mut self) -> &mut HostRow {
        self.effect = CallEffect::Idempotent;
        self
    }

    /// Notes that a call lets go of a part of one of its arguments.
    pub fn releases(&mut self) -> &mut HostRow {
        self.effect = CallEffect::Releases;
        self
    }

    /// Notes that the effect of a call lasts until one of its objects is closed, be it an argument or a
    /// value: the next process of a durable run makes the call again.
    pub fn lasts(&mut self) -> &mut HostRow {
        self.effect = CallEffect::Lasts;
        self
    }

    /// Notes that a call closes one of its arguments.
    pub fn closes(&mut self) -> &mut HostRow {
        self.effect = CallEffect::Closes;
        self
    }
}

/// Code of a function with these arguments.
pub trait Handler<A, R>: Send + 'static {
    /// Calls it.
    fn handle(&mut self, arguments: A) -> R;
}

/// Functions that the host gives to the programs of one machine.
pub struct HostRows {
    rows: Vec<HostRow>,
    inbox: Inbox,
}

impl HostRows {
    /// Creates an empty list, for the machine with this inbox.
    pub fn new(inbox: &Inbox) -> HostRows {
        HostRows { rows: Vec::new(), inbox: inbox.clone() }
    }

    /// Adds a function that returns at once. Its Rust code has as many parameters for arguments of the
    /// program as there are names. A panic in it is a failure `:host-panic` of the call.
    pub fn at_once<A: ArgumentList, R: IntoDatum, const N: usize>(
        &mut self,
        name: &'static str,
        parameters: [&'static str; N],
        documentation: &'static str,
        mut function: impl Handler<A, Result<R, HostFailure>>,
    ) -> &mut HostRow {
        const { assert!(N == A::COUNT, "a row names each parameter of its code") };
        let inbox = self.inbox.clone();
        let function = move |data: &[Datum]| {
            let arguments = A::read(&mut ArgumentReader::new(data, &inbox, None))?;
            let result = catch_unwind(AssertUnwindSafe(|| function.handle(arguments)));
            result.unwrap_or_else(|panic| Err(HostFailure::of_panic(&*panic))).map(R::into_datum)
        };
        self.add(name, parameters.to_vec(), documentation, HostFunction::AtOnce(Box::new(function)))
    }

    /// Adds a function without parameters that returns a new object of this type. A program has the object
    /// before the operation that opens it, so that a call that is left early leaves nothing open.
    pub fn constructor<T: HostObject + Default>(
        &mut self,
        name: &'static str,
        documentation: &'static str,
    ) -> &mut HostRow {
        let mut made = 0;
        self.at_once(name, [], documentation, move || {
            made += 1;
            Ok(HostHandle::new(made, T::default()))
        })
        .local()
    }

    /// Adds a function whose calls are operations: `begin` begins the future that its Rust code returns.
    pub fn operation<A: ArgumentList, F, V: IntoValues, const N: usize>(
        &mut self,
        begin: BeginFuture,
        name: &'static str,
        parameters: [&'static str; N],
        documentation: &'static str,
        mut function: impl Handler<A, F>,
    ) -> &mut HostRow
    where
        F: Future<Output = Result<V, HostFailure>> + Send + 'static,
    {
        const { assert!(N == A::COUNT, "a row names each parameter of its code") };
        let inbox = self.inbox.clone();
        let function = move |mut operation: HostOperation| {
            let data = operation.take_arguments();
            let arguments = A::read(&mut ArgumentReader::new(&data, &inbox, Some(&operation)));
            let future = arguments.and_then(|arguments| {
                let begun = catch_unwind(AssertUnwindSafe(|| function.handle(arguments)));
                begun.map_err(|panic| HostFailure::of_panic(&*panic))
            });
            match future {
                Ok(future) => begin(operation, Box::pin(async move { future.await.map(V::into_values) })),
                Err(failure) => operation.fail(failure),
            }
        };
        self.add(name, parameters.to_vec(), documentation, HostFunction::Operation(Box::new(function)))
    }

    fn add(
        &mut self,
        name: &'static str,
        parameters: Vec<&'static str>,
        documentation: &'static str,
        function: HostFunction,
    ) -> &mut HostRow {
        let needs = Vec::new();
        let (is_everywhere, effect) = (false, CallEffect::default());
        let row = HostRow { name, parameters, documentation, needs, is_everywhere, effect, function };
        self.rows.push(row);
        self.rows.last_mut().expect("one was added")
    }

    /// Returns the rows.
    pub fn iter(&self) -> impl Iterator<Item = &HostRow> {
        self.rows.iter()
    }
}

impl IntoIterator for HostRows {
    type Item = HostRow;
    type IntoIter = std::vec::IntoIter<HostRow>;

    fn into_iter(self) -> Self::IntoIter {
        self.rows.into_iter()
    }
}

/// A module in ESL, with the functions of the host that it calls.
#[derive(Clone, Copy)]
pub struct HostModule {
    /// Its name, in lower case.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
    /// Makes the rows of its functions, for the machine with this inbox.
    pub rows: fn(&Inbox) -> HostRows,
}

/// Returns the definitions of rows as data: of each its name, the names of its parameters, its docstring, and
/// whether it waits.
pub fn definitions(rows: &HostRows) -> Datum {
    let upper = |name: &str| name.to_uppercase().into_datum();
    let row = |row: &HostRow| {
        let parameters: Vec<Datum> = row.parameters.iter().map(|name| upper(name)).collect();
        vec![
            upper(row.name),
            parameters.into_datum(),
            row.documentation.into_datum(),
            row.waits().into_datum(),
        ]
    };
    rows.iter().map(|each| row(each).into_datum()).collect::<Vec<_>>().into_datum()
}

/// Returns the faults of the rows of modules, for a test of the crate that has them: rows that no text of
/// `modules` calls, rows without a sentence as their docstring, and texts that define the functions of rows
/// although there are none, or the other way round.
pub fn unused_functions(modules: &[HostModule]) -> Vec<String> {
    let texts: Vec<String> = modules.iter().map(|module| module.text.to_lowercase()).collect();
    let mut faults = Vec::new();
    for (HostModule { name, rows, .. }, text) in modules.iter().zip(&texts) {
        let rows = rows(&Inbox::new());
        let defines = text.contains(&format!("(esl::%define-host-functions \"{name}\")"));
        if defines != rows.iter().next().is_some() {
            faults.push(format!("{name} has rows without their definitions, or definitions without rows"));
        }
        for row in rows.iter() {
            let call = row.name.to_lowercase();
            if !texts.iter().any(|text| text.contains(&call)) {
                faults.push(format!("no module calls {}", row.name));
            }
            if !row.documentation.ends_with('.') {
                faults.push(format!("the docstring of {} is not a sentence", row.name));
            }
        }
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Canceller;
    use crate::{HostHandle, HostObject, Incoming, News};

    struct Counter(std::sync::atomic::AtomicI64);

    impl HostObject for Counter {
        const KIND: &'static str = "COUNTER";
    }

    fn rows() -> HostRows {
        let mut rows = HostRows::new(&Inbox::new());
        let mut made = 0;
        rows.at_once("%NEW", [], "Makes a counter.", move || {
            made += 1;
            Ok(HostHandle::new(made, Counter(0.into())))
        });
        rows.at_once("%COUNT", ["counter", "by"], "Counts.", |counter: HostHandle<Counter>, by: i64| {
            Ok(by + counter.0.fetch_add(by, std::sync::atomic::Ordering::Relaxed))
        });
        rows.operation(
            |operation, future| {
                let mut future = future;
                let poll =
                    future.as_mut().poll(&mut std::task::Context::from_waker(std::task::Waker::noop()));
                match poll {
                    std::task::Poll::Ready(Ok(values)) => operation.complete(values),
                    std::task::Poll::Ready(Err(failure)) => operation.fail(failure),
                    std::task::Poll::Pending => {}
                }
            },
            "%SPLIT",
            ["text"],
            "Splits a text.",
            |text: String| async move {
                let (a, b) = text.split_once('/').ok_or_else(|| HostFailure::new("NO-SLASH", &text))?;
                Ok((a.to_owned(), b.len() as i64))
            },
        )
        .needs(Right::Read, "text");
        rows
    }

    fn call(rows: &mut [HostRow], index: usize, arguments: &[Datum]) -> String {
        let HostFunction::AtOnce(function) = &mut rows[index].function else { panic!("it waits") };
        match function(arguments) {
            Ok(value) => value.to_string(),
            Err(failure) => format!("{} {:?}", failure.cause, failure.arguments),
        }
    }

    #[test]
    fn rust_gets_typed_arguments_and_esl_a_definition() {
        assert_eq!(
            definitions(&rows()).to_string(),
            "((\"%NEW\" NIL \"Makes a counter.\" NIL) (\"%COUNT\" (\"COUNTER\" \"BY\") \"Counts.\" NIL) \
             (\"%SPLIT\" (\"TEXT\") \"Splits a text.\" T))"
        );
        let mut rows: Vec<HostRow> = rows().into_iter().collect();
        assert_eq!(rows[2].needs, [Need { right: Right::Read, argument: 0 }]);
        let HostFunction::AtOnce(new) = &mut rows[0].function else { panic!("it waits") };
        let counter = new(&[]).expect("there is room");
        assert_eq!(counter.to_string(), "#<COUNTER 1>");
        assert_eq!(call(&mut rows, 1, &[counter.clone(), 2_i64.into_datum()]), "2");
        assert_eq!(call(&mut rows, 1, &[counter.clone(), 3_i64.into_datum()]), "5");
        assert_eq!(call(&mut rows, 1, &[counter, "x".into_datum()]), "TYPE-ERROR [\"x\", \"INTEGER\"]");
        assert_eq!(call(&mut rows, 1, &[1_i64.into_datum()]), "TYPE-ERROR [1, \"COUNTER\"]");
    }

    #[test]
    fn a_panic_is_a_failure_of_the_call() {
        let mut rows = HostRows::new(&Inbox::new());
        rows.at_once("%PANIC", [], "Panics.", || -> Result<(), HostFailure> { panic!("it is wrong") });
        let mut rows: Vec<HostRow> = rows.into_iter().collect();
        assert_eq!(call(&mut rows, 0, &[]), "HOST-PANIC [\"it is wrong\"]");
    }

    #[test]
    fn an_operation_completes_with_the_values_of_its_future() {
        let mut rows: Vec<HostRow> = rows().into_iter().collect();
        let HostFunction::Operation(split) = &mut rows[2].function else { panic!("it does not wait") };
        let mut heard = |argument: Datum| {
            let inbox = Inbox::new();
            split(HostOperation::new(1, vec![argument], inbox.clone(), Canceller::default()));
            match &inbox.take()[..] {
                [Incoming::Operation { news: News::Completed(values), .. }] => format!("{values:?}"),
                [Incoming::Operation { news: News::Failed(failure), .. }] => {
                    format!("{} {:?}", failure.cause, failure.arguments)
                }
                other => format!("{other:?}"),
            }
        };
        assert_eq!(heard("a/bc".into_datum()), "[\"a\", 2]");
        assert_eq!(heard("abc".into_datum()), "NO-SLASH [\"abc\"]");
        assert_eq!(heard(1_i64.into_datum()), "TYPE-ERROR [1, \"STRING\"]");
    }
}
