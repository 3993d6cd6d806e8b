//! A scope: the view of a run that servers have.

use std::time::Duration;

use esl_host::{Inbox, Inspection, Sender, Survey, SurveyRequest};
use esl_vm::vm::Vm;
use tokio::sync::oneshot;

/// Longest time that a survey is waited for. A machine that runs a critical section answers late.
const PATIENCE: Duration = Duration::from_secs(10);

/// The view of one run.
#[derive(Clone)]
pub(super) struct RunScope {
    inbox: Inbox,
    /// Most bytes of its objects.
    memory: usize,
}

impl RunScope {
    /// Creates a view of the run of a machine.
    pub(super) fn new(machine: &Vm) -> RunScope {
        RunScope { inbox: machine.inbox(), memory: machine.config().memory }
    }

    /// Returns the most bytes that the objects of the run may take.
    pub(super) fn memory(&self) -> usize {
        self.memory
    }

    /// Returns a sender for signals and questions.
    pub(super) fn sender(&self) -> Sender {
        Sender::new(&self.inbox)
    }

    /// Returns what there is to see; `None` if the machine is gone, or does not answer.
    pub(super) async fn survey(&self, request: SurveyRequest) -> Option<Survey> {
        let (tell, told) = oneshot::channel();
        // The receiver may be gone.
        self.inbox.inspect(Inspection::Survey(request, Box::new(move |survey| drop(tell.send(survey)))));
        tokio::time::timeout(PATIENCE, told).await.ok()?.ok()
    }
}
