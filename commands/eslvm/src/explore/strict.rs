//! Fragile updates: those that are safe only because no tick lies between a read and a write.

use esl_command::say;

use super::{CommandExploration, Searched, TellError, tell};

impl CommandExploration<'_> {
    /// Tries all schedules of the program with points before the uses of places that tasks may share, and
    /// tells of those that end badly only then. Returns whether there are some.
    ///
    /// # Errors
    /// [`TellError`].
    pub(super) fn try_strictly(&self) -> Result<bool, TellError> {
        let Some(program) = self.marked() else { return Err(TellError::NoSource) };
        let searched = self.search_grains(program, true)?;
        let Searched { settings, scope, findings, .. } = &searched;
        for (finding, number) in findings.iter().zip(1..) {
            let steps = self.tell((program, settings), finding, &format!("fragile {number}"), number)?;
            if self.options.json {
                continue;
            }
            if let Some(places) = tell::fragile_places(&steps) {
                let mut forms = self.forms.borrow_mut();
                say!(
                    "  {} is used at two places, and only the lack of a call between them keeps",
                    places.target
                );
                say!("  other tasks out; `without-interrupts` around both does so by intent:");
                say!("    {}", forms.describe(&places.first));
                say!("    {}\n", forms.describe(&places.second));
            }
        }
        if self.options.json {
            self.say_figures(&searched);
            return Ok(!findings.is_empty());
        }
        match (findings.len(), scope.why_not_complete()) {
            (0, None) => say!(
                "not fragile: no schedule ends badly with switches before each use of a shared place ({scope})"
            ),
            (0, Some(why)) => say!("fragile or not: not known, since {why} ({scope})"),
            (count, _) => {
                say!("fragile: findings: {count} ({scope}, with switches before each use of a shared place)")
            }
        }
        Ok(!findings.is_empty())
    }
}
