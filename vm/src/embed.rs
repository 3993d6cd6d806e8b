//! What an embedder does with a machine beside running it: data in and out, and functions of its own.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;

use crate::datum::Unit;
use crate::heap::HeapStats;
use crate::host::Output;
use crate::raise::{Exit, Outcome, Raised};
use crate::schedule::Choices;
use crate::task::TaskId;
use crate::value::Value;
use crate::vm::{Config, Vm};

/// A function that the embedder gives to programs. It gets and gives data, and cannot call back.
pub type HostFunction = Box<dyn FnMut(&[Datum]) -> Result<Datum, String> + Send>;

impl Vm {
    /// Takes in a function of the embedder: its number, for `%call-host`.
    pub fn add_host_function(&mut self, function: HostFunction) -> usize {
        self.host_functions.push(function);
        self.host_functions.len() - 1
    }

    /// A value as data. Objects that no data stands for, such as functions and hash tables, come out as a string that
    /// describes them.
    ///
    /// # Errors
    /// A text, if the value is circular, or too large.
    pub fn export(&mut self, value: Value) -> Result<Datum, String> {
        let mut unit = Unit::default();
        let datum = unit
            .datum_of(&self.heap, &self.world, value, Span::default())
            .map_err(|error| error.to_string())?;
        self.charge(unit.take_work() as usize);
        Ok(datum)
    }

    /// Data as a value.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn import(&mut self, datum: &Datum) -> Result<Value, Exit> {
        let mut unit = Unit::default();
        let value = unit.value_of(&mut self.heap, &mut self.world, datum)?;
        self.charge(unit.take_work() as usize);
        Ok(value)
    }
}

/// `(%call-host number &rest arguments)`
pub(crate) fn call_host(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let number = arguments[0].as_index().filter(|&number| number < vm.host_functions.len());
    let Some(number) = number else { return vm.index_error(arguments[0], vm.host_functions.len()) };
    let mut data = Vec::with_capacity(arguments.len());
    for &argument in &arguments[1..] {
        match vm.export(argument) {
            Ok(datum) => data.push(datum),
            Err(text) => return vm.raise(Raised::Simple(text)),
        }
    }
    // The function has effects that cannot be done twice, so what it gives is kept until there is room for it.
    let answer = match vm.host_answer.take() {
        Some(answer) => answer,
        None => (vm.host_functions[number])(&data),
    };
    match answer {
        Ok(datum) => match vm.import(&datum) {
            Ok(value) => Ok(value),
            Err(exit) => {
                vm.host_answer = Some(Ok(datum));
                Err(exit)
            }
        },
        Err(text) => vm.raise(Raised::Simple(text)),
    }
}

impl Vm {
    /// The function of the library with this name, internal to the package `ESL`.
    ///
    /// # Errors
    /// A text, if the library has none.
    pub fn library_function(&mut self, name: &str) -> Result<Value, String> {
        let symbol =
            self.world.intern_esl(&mut self.heap, name).map_err(|_| "there is no memory left".to_string())?;
        if self.is_defined(symbol) { Ok(symbol) } else { Err(format!("the library has no function {name}")) }
    }

    /// Makes a task that calls a function of the library.
    ///
    /// # Errors
    /// A text, if the library has no such function, or there is no room for a task.
    pub fn spawn_library(&mut self, name: &str, arguments: &[Value]) -> Result<TaskId, String> {
        let function = self.library_function(name)?;
        self.spawn(function, arguments).map_err(|_| "there is no memory left for a task".into())
    }

    /// Settings that count from here on; ticks are counted anew.
    pub fn begin_program(&mut self, config: Config) {
        self.config = Config { memory: self.config.memory, ..config };
        self.choices = Choices::seeded(self.config.seed);
        self.spent = 0;
        (self.looked_at, self.moved_at, self.made, self.turns, self.switches) = (0, 0, 0, 0, 0);
    }

    /// Writes what the program has printed and is still in a buffer.
    pub fn flush(&mut self) {
        self.flush_output();
    }

    /// Writes reports from here on to this stream, in place of the standard error output.
    pub fn complain_to(&mut self, output: Output) {
        self.complaints = output;
    }

    /// Writes a report, on lines of its own.
    pub fn complain(&mut self, text: &str) {
        let mut characters: Vec<u32> = text.chars().map(u32::from).collect();
        if self.console.column(self.complaints) > 0 {
            characters.insert(0, u32::from('\n'));
        }
        self.flush_output();
        self.console.write(&mut *self.host, self.complaints, &characters);
        self.flush_output();
    }

    /// Whether a condition that ended a task says that the memory is exhausted.
    pub fn is_heap_exhausted(&self, condition: Value) -> bool {
        if condition == self.world.known.heap_exhausted {
            return true;
        }
        let class = self.heap.structure_class(condition);
        let name = class.and_then(|class| self.heap.symbol(self.class_name(class)));
        name.and_then(|symbol| self.heap.string_text(symbol.name))
            .is_some_and(|name| name == "HEAP-EXHAUSTED")
    }

    /// Figures of the heap.
    pub fn heap_stats(&self) -> HeapStats {
        self.heap.stats()
    }
}
