//! Questions to the database of a program.

use esl_host::{Answer, FunctionRef};

use super::handle::{Handle, Reply};
use crate::data::{Data, FromData};
use crate::error::Error;

/// One answer to a query: the values of its variables.
///
/// ```
/// use esl::{Data, Engine};
///
/// let mut engine = Engine::new()?;
/// engine.eval("(progn (assert '(at rover ridge)) (assert '(at probe (3 4))))")?;
/// let places = engine.handle().query("(at ?robot ?place)".parse::<Data>()?);
/// engine.run();
/// let places = places.wait()?;
/// assert_eq!(places[0].get::<String>("robot"), None, "it is a symbol, not a string");
/// assert_eq!(places[0].data("?robot").map(ToString::to_string), Some("ROVER".into()));
/// assert_eq!(places[1].get::<Vec<i64>>("place"), Some(vec![3, 4]));
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct QueryAnswer(Vec<(String, Data)>);

impl QueryAnswer {
    /// Returns the value of a variable, by its name in any case, with or without its question mark; `None`
    /// if the query does not bind it.
    pub fn data(&self, variable: &str) -> Option<&Data> {
        let name = variable.trim_start_matches('?');
        self.0.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    /// Returns the value of a variable, converted; `None` also if it is of another type.
    pub fn get<T: FromData>(&self, variable: &str) -> Option<T> {
        self.data(variable).and_then(T::from_data)
    }

    /// Returns the variables, without question marks, and their values, in the order of the query.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Data)> {
        self.0.iter().map(|(name, value)| (&**name, value))
    }

    /// Returns the bindings that a list of pairs stands for.
    pub(super) fn of_list(pairs: &Data) -> Option<QueryAnswer> {
        pairs.as_list()?.iter().map(binding).collect::<Option<_>>().map(QueryAnswer)
    }
}

/// Returns the variable and the value of a pair.
fn binding(pair: &Data) -> Option<(String, Data)> {
    let (name, value) = match pair {
        Data::List(items) => (items.first()?, Data::list(items[1..].iter().cloned())),
        Data::DottedList(items, tail) if items.len() == 1 => (&items[0], (**tail).clone()),
        Data::DottedList(items, tail) => (items.first()?, Data::DottedList(items[1..].into(), tail.clone())),
        _ => return None,
    };
    let Data::Symbol(name) = name else { return None };
    Some((name.trim_start_matches('?').to_owned(), value))
}

impl Handle {
    /// Asks the program's database. The query is what `db-query` takes: a pattern, `(and query…)`,
    /// `(or query…)` or `(not query)`. The answers are in the order in which the facts were asserted.
    pub fn query(&self, query: impl Into<Data>) -> Reply<Vec<QueryAnswer>> {
        let function = FunctionRef::Named("ESL:DB-QUERY".into());
        Reply::new(self.ask_pending(function, [query.into()], true), read_bindings)
    }
}

fn read_bindings(answer: Answer) -> Result<Vec<QueryAnswer>, Error> {
    let answers: Data = super::handle::read_value(answer)?;
    let bindings: Option<Vec<QueryAnswer>> =
        answers.as_list().and_then(|answers| answers.iter().map(QueryAnswer::of_list).collect());
    bindings.ok_or_else(|| Error::NotOfType { value: answers.to_string(), expected: "LIST" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Engine;

    /// Returns the answers to a query, as texts.
    fn answers(query: &str) -> Vec<String> {
        let mut engine = Engine::new().expect("there is memory");
        let facts = "(progn (assert '(goal (a . b))) (assert '(goal nil)) (assert '(goal (a b . c))))";
        engine.eval(facts).expect("it evaluates");
        let answers = engine.handle().query(query.parse::<Data>().expect("it is a datum"));
        engine.run();
        let text = |bindings: &QueryAnswer| {
            let texts: Vec<String> = bindings.iter().map(|(name, value)| format!("{name}={value}")).collect();
            texts.join(" ")
        };
        answers.wait().expect("it is a query").iter().map(text).collect()
    }

    #[test]
    fn a_binding_keeps_the_shape_of_its_value() {
        assert_eq!(answers("(goal ?x)"), ["X=(A . B)", "X=NIL", "X=(A B . C)"]);
        assert_eq!(answers("(goal nil)"), [""], "an answer without variables");
        assert_eq!(answers("(goal 5)"), [""; 0]);
    }
}
