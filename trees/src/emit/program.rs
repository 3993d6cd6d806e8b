//! The text of a whole program.

use std::collections::HashSet;

use crate::emit::Emitter;
use crate::emit::form::FormId;

/// The macro by which calls of actions note their errors.
const NOTING_ERROR: &str = "\
(defmacro noting-error ((code &optional text) &body body)
  \"Sets CODE and TEXT to those of the result of the goal with which BODY has failed, CODE to 0 if it succeeds.\"
  `(multiple-value-prog1
       (handler-bind ((failure (lambda (failure)
                                 (when (eq (failure-cause failure) :goal-aborted)
                                   (let ((result (first (failure-arguments failure))))
                                     (setf ,code (getf result :error-code)
                                           ,@(when text `(,text (getf result :error-msg)))))))))
         ,@body)
     (setf ,code 0)))
";

impl Emitter<'_> {
    /// Returns the text of the program.
    pub(super) fn text(mut self, title: &str) -> String {
        let mut text = format!(";;;; {title}, imported by `eslc import`.\n");
        let uses_ros = self.leaves.use_ros();
        if self.needs_bt || uses_ros {
            text.push('\n');
        }
        for (is_used, module) in [(self.needs_bt, ":bt"), (uses_ros, ":ros")] {
            if is_used {
                text.push_str(&format!("(require {module})\n"));
            }
        }
        let mut definitions = self.leaf_definitions();
        definitions.extend(self.measure_definitions());
        let functions = std::mem::take(&mut self.functions);
        let functions: Vec<FormId> = functions.into_iter().rev().flatten().collect();
        let used: HashSet<String> = definitions
            .iter()
            .chain(&functions)
            .flat_map(|&form| self.forms.all_atoms(form))
            .filter(|atom| self.causes.contains(*atom))
            .map(str::to_owned)
            .collect();
        let causes: Vec<String> = self.causes.iter().filter(|cause| used.contains(*cause)).cloned().collect();
        if !causes.is_empty() {
            text.push('\n');
        }
        for cause in causes {
            let form = self.forms.atoms(&["define-cause", &cause, "()"]);
            self.forms.print(form, &mut text);
        }
        if uses_ros {
            text.push_str("\n(defvar *node* nil \"Node of ROS.\")\n");
        }
        if self.notes_errors {
            text.push('\n');
            text.push_str(NOTING_ERROR);
        }
        if !self.globals.is_empty() {
            text.push('\n');
        }
        let mut globals = std::mem::take(&mut self.globals);
        globals.sort_by(|one, other| one.name.cmp(&other.name));
        for global in globals {
            let text_form = self.text_literal(&global.documentation);
            let parts = [self.forms.atom(global.name), self.forms.atom(global.initial), text_form];
            let form = self.forms.call("define-fluent", 3, parts);
            self.forms.print(form, &mut text);
        }
        self.print_section("leaves: the actions and checks of the robot, empty", &definitions, &mut text);
        self.print_section("the tree", &functions, &mut text);
        let main = self.instances.first().map(|instance| instance.function.clone()).unwrap_or_default();
        let mut call = self.forms.atoms(&[&main]);
        if uses_ros {
            let binding = self.forms.atoms(&["node", "\"bt_navigator\""]);
            let setting = self.forms.atoms(&["setf", "*node*", "node"]);
            call = self.forms.call("ros:with-node", 2, [binding, setting, call]);
        }
        text.push('\n');
        self.forms.print(call, &mut text);
        text
    }

    fn print_section(&mut self, heading: &str, definitions: &[FormId], text: &mut String) {
        if definitions.is_empty() {
            return;
        }
        text.push_str(&format!("\n;;; ---- {heading}\n"));
        for &definition in definitions {
            text.push('\n');
            self.forms.print(definition, text);
        }
    }

    fn measure_definitions(&mut self) -> Vec<FormId> {
        let measures = std::mem::take(&mut self.measures);
        let mut define = |(wanted, function): (String, String)| {
            let documentation = if wanted == "odometer" {
                "Returns the metres that the robot has travelled."
            } else {
                "Returns the speed of the robot in metres per second."
            };
            let quoted = format!("'{function}");
            self.causes.insert(":not-implemented".into());
            let parts = [
                self.forms.atom(function),
                self.forms.list(1, []),
                self.text_literal(documentation),
                self.forms.atoms(&["fail", ":not-implemented", &quoted]),
            ];
            self.forms.call("defun", 3, parts)
        };
        measures.into_iter().map(&mut define).collect()
    }
}
