//! The table of the host: its agents, those that are awake, and those that wait for a place.
//!
//! Guarantees: an agent that cannot go on, or whose folder is damaged, holds up no other one. A letter that
//! was answered is in the journal of its agent. The folders have all knowledge of the host, which can be
//! killed at any place.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use esl_durable::{DurableControl, DurableError, RunFolder, RunRest};
use esl_host::Inbox;
use esl_vm::vm::Vm;

use super::agent::run_agent;
use super::error::AgentError;
use super::folder::{agent_folder, agent_names, is_stopped, note_stopped};
use super::mailbox::{AgentMailbox, Letter};
use super::outside::{AwakeFlags, SleepRule};
use super::settings::{HostSettings, HostSurroundings};

/// How an agent stands.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AgentStanding {
    /// It sleeps until this time of day, in nanoseconds since 1970, or until a message comes.
    Asleep(Option<i64>),
    /// It waits for a place among those that are awake.
    Waiting,
    /// It has a machine.
    Awake,
    /// Its run has ended with this status.
    Ended(u8),
    /// It was stopped, until it is started.
    Stopped,
    /// It cannot go on: the reason. It is tried again at the time, if there is one.
    Failed(String, Option<i64>),
}

/// An agent that has a machine.
pub(crate) struct AwakeAgent {
    pub(crate) control: DurableControl,
    pub(crate) inbox: Inbox,
    pub(crate) flags: Arc<AwakeFlags>,
    /// Start of the addresses of its objects.
    pub(crate) range: Option<usize>,
}

/// An agent, as the host knows it. There may be very many.
struct Agent {
    standing: AgentStanding,
    mailbox: Option<Arc<AgentMailbox>>,
    awake: Option<Box<AwakeAgent>>,
    /// Whether it cannot sleep.
    is_tied: bool,
    /// Whether it is to be stopped.
    stops: bool,
    /// Number of tries to go on that have failed in a row.
    failures: u8,
}

impl Agent {
    fn new(standing: AgentStanding) -> Agent {
        Agent { standing, mailbox: None, awake: None, is_tied: false, stops: false, failures: 0 }
    }

    /// Returns when it goes on by itself.
    fn due(&self) -> Option<i64> {
        match &self.standing {
            AgentStanding::Asleep(due) | AgentStanding::Failed(_, due) => *due,
            _ => None,
        }
    }
}

#[derive(Default)]
struct Agents {
    known: HashMap<Arc<str>, Agent>,
    /// Those that go on by themselves, by time.
    due: BTreeSet<(i64, Arc<str>)>,
    /// Those that wait for a place.
    ready: VecDeque<Arc<str>>,
    /// Those whose addresses another one has that is awake.
    blocked: Vec<Arc<str>>,
    awake: usize,
    tied: usize,
    is_stopping: bool,
}

impl Agents {
    /// Notes how an agent stands from here on.
    fn set(&mut self, name: &Arc<str>, standing: AgentStanding) {
        let Some(agent) = self.known.get_mut(name) else { return };
        if let Some(due) = agent.due() {
            self.due.remove(&(due, name.clone()));
        }
        agent.standing = standing;
        if let Some(due) = agent.due() {
            self.due.insert((due, name.clone()));
        }
        if agent.standing == AgentStanding::Waiting {
            self.ready.push_back(name.clone());
        }
    }
}

/// The host, as all of its threads share it.
pub(crate) struct HostTable {
    pub(crate) folder: PathBuf,
    pub(crate) settings: HostSettings,
    pub(crate) rule: Arc<SleepRule>,
    surroundings: HostSurroundings,
    agents: Mutex<Agents>,
    /// Notified when an agent wants a place, has left one, or the host is to stop.
    changed: Condvar,
    /// Locked until the host is gone.
    _lock: RunFolder,
}

/// Returns the time of day in nanoseconds since 1970.
fn wall_clock() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |time| i64::try_from(time.as_nanos()).unwrap_or(i64::MAX))
}

/// Returns how an agent stands by the notes in its folder.
fn standing_of(agent: &std::path::Path) -> AgentStanding {
    match RunRest::read(agent) {
        Some(RunRest::Ended(status)) => AgentStanding::Ended(status),
        _ if is_stopped(agent) => AgentStanding::Stopped,
        Some(RunRest::Asleep(due)) => AgentStanding::Asleep(due),
        None => AgentStanding::Waiting,
    }
}

impl HostTable {
    /// Takes the folder of the agents, which is made if there is none, and looks who is there.
    pub(crate) fn open(
        folder: PathBuf,
        mut settings: HostSettings,
        surroundings: HostSurroundings,
    ) -> Result<Arc<HostTable>, AgentError> {
        settings.durable.hosted = Some(wall_clock());
        let lock = RunFolder::open(&folder)?;
        lock.keep();
        let rule = SleepRule { after: settings.sleep_after, is_crowded: AtomicBool::new(false) };
        let mut agents = Agents::default();
        let names = agent_names(&folder).map_err(|error| AgentError::Folder(folder.clone(), error))?;
        for name in names {
            let standing = standing_of(&agent_folder(&folder, &name)?);
            let name: Arc<str> = name.into();
            agents.known.insert(name.clone(), Agent::new(AgentStanding::Stopped));
            agents.set(&name, standing);
        }
        Ok(Arc::new(HostTable {
            folder,
            settings,
            rule: Arc::new(rule),
            surroundings,
            agents: Mutex::new(agents),
            changed: Condvar::new(),
            _lock: lock,
        }))
    }

    fn agents(&self) -> MutexGuard<'_, Agents> {
        // Each change is made as a whole, so a panic elsewhere does not corrupt the table.
        self.agents.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn prepare(&self, machine: &mut Vm) {
        (self.surroundings.prepare)(machine);
    }

    pub(crate) fn print(&self, name: &str, bytes: &[u8]) {
        (self.surroundings.print)(name, bytes);
    }

    pub(crate) fn report(&self, name: &str, text: &str) {
        (self.surroundings.report)(name, text);
    }

    /// Notes that an agent has opened its run, so that it can be reached.
    pub(crate) fn note_open(&self, name: &Arc<str>, awake: AwakeAgent) {
        let mut agents = self.agents();
        let is_stopping = agents.is_stopping;
        let Some(agent) = agents.known.get_mut(name) else { return };
        if is_stopping || agent.stops {
            awake.control.pause();
        }
        agent.awake = Some(Box::new(awake));
    }

    /// Has the agent that is awake at these addresses sleep when it waits, since another one needs them.
    pub(crate) fn make_room(&self, name: &str, range: usize) {
        let agents = self.agents();
        for (other, agent) in &agents.known {
            let Some(awake) = &agent.awake else { continue };
            if &**other != name && awake.range == Some(range) {
                awake.flags.is_in_the_way.store(true, Ordering::Relaxed);
                awake.inbox.ring();
            }
        }
    }

    /// Notes that an agent cannot sleep, so that it keeps nobody else from a place.
    pub(crate) fn note_tied(&self, name: &Arc<str>) {
        let mut agents = self.agents();
        if let Some(agent) = agents.known.get_mut(name)
            && !std::mem::replace(&mut agent.is_tied, true)
        {
            agents.tied += 1;
            self.changed.notify_all();
        }
    }

    /// Posts a letter to an agent, which is woken for it.
    pub(crate) fn post(self: &Arc<HostTable>, name: &str, letter: Letter) {
        let mut agents = self.agents();
        let is_stopping = agents.is_stopping;
        let Some((name, agent)) = agents.known.get_key_value(name) else {
            return letter.answer(Err(AgentError::NoAgent(name.into())));
        };
        let name = name.clone();
        let refusal = match &agent.standing {
            _ if is_stopping => Some(AgentError::Leaving),
            _ if agent.stops => Some(AgentError::Stopped),
            AgentStanding::Ended(status) => Some(AgentError::Ended(*status)),
            AgentStanding::Stopped => Some(AgentError::Stopped),
            AgentStanding::Failed(reason, None) => Some(AgentError::Failed(reason.clone())),
            _ => None,
        };
        if let Some(refusal) = refusal {
            return letter.answer(Err(refusal));
        }
        let Some(agent) = agents.known.get_mut(&name) else { return };
        agent.mailbox.get_or_insert_default().put(letter);
        if let Some(awake) = &agent.awake {
            awake.inbox.ring();
        }
        if let AgentStanding::Asleep(_) = agent.standing {
            agents.set(&name, AgentStanding::Waiting);
            // At once, without a turn of the thread that serves: on a busy processor that may take long.
            self.give_places(&mut agents);
            self.changed.notify_all();
        }
    }

    /// Starts an agent that was stopped, has failed, or is new in the folder; wakes one that sleeps.
    pub(crate) fn start(&self, name: &str) -> Result<(), AgentError> {
        let path = agent_folder(&self.folder, name)?;
        if !path.is_dir() {
            return Err(AgentError::NoAgent(name.into()));
        }
        note_stopped(&path, false)?;
        let mut agents = self.agents();
        let name: Arc<str> = name.into();
        let agent = agents.known.entry(name.clone()).or_insert_with(|| Agent::new(AgentStanding::Stopped));
        agent.failures = 0;
        match agent.standing {
            AgentStanding::Awake | AgentStanding::Waiting => agent.stops = false,
            // The folder may have another run since.
            AgentStanding::Ended(status) if RunRest::read(&path) == Some(RunRest::Ended(status)) => {
                return Err(AgentError::Ended(status));
            }
            _ => agents.set(&name, AgentStanding::Waiting),
        }
        self.changed.notify_all();
        Ok(())
    }

    /// Stops an agent, until it is started. Returns when it has left its machine.
    pub(crate) fn stop(&self, name: &str) -> Result<(), AgentError> {
        let path = agent_folder(&self.folder, name)?;
        let mut agents = self.agents();
        let Some(agent) = agents.known.get_mut(name) else { return Err(AgentError::NoAgent(name.into())) };
        if let AgentStanding::Ended(status) = agent.standing {
            return Err(AgentError::Ended(status));
        }
        note_stopped(&path, true)?;
        agent.stops = true;
        if let Some(awake) = &agent.awake {
            awake.control.pause();
        }
        let name: Arc<str> = name.into();
        if !matches!(agent.standing, AgentStanding::Awake | AgentStanding::Waiting) {
            agents.set(&name, AgentStanding::Stopped);
        }
        let is_leaving = |agents: &mut Agents| {
            agents.known.get(&name).is_some_and(|agent| {
                agent.stops && matches!(agent.standing, AgentStanding::Awake | AgentStanding::Waiting)
            })
        };
        let mut agents = self.changed.wait_while(agents, is_leaving).unwrap_or_else(PoisonError::into_inner);
        if let Some(agent) = agents.known.get_mut(&name) {
            agent.stops = false;
        }
        Ok(())
    }

    /// Returns all agents, or those of a name.
    pub(crate) fn list(&self, wanted: Option<&str>) -> Vec<(Arc<str>, AgentStanding)> {
        let agents = self.agents();
        let of = |(name, agent): (&Arc<str>, &Agent)| (name.clone(), agent.standing.clone());
        match wanted {
            Some(name) => agents.known.get_key_value(name).map(of).into_iter().collect(),
            None => agents.known.iter().map(of).collect(),
        }
    }

    /// Has all agents leave their machines, and the host end.
    pub(crate) fn end(&self) {
        let mut agents = self.agents();
        agents.is_stopping = true;
        agents.known.values().filter_map(|agent| agent.awake.as_ref()).for_each(|awake| {
            awake.control.pause();
        });
        self.changed.notify_all();
    }

    /// Returns whether the host is about to end.
    pub(crate) fn is_ending(&self) -> bool {
        self.agents().is_stopping
    }

    /// Gives agents places until the host is to end, and all have left.
    pub(crate) fn serve(self: &Arc<HostTable>) {
        let mut agents = self.agents();
        loop {
            if agents.is_stopping {
                if agents.awake == 0 {
                    break;
                }
                agents = self.changed.wait(agents).unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let now = wall_clock();
            while let Some((due, name)) = agents.due.first().cloned()
                && due <= now
            {
                agents.set(&name, AgentStanding::Waiting);
            }
            self.give_places(&mut agents);
            let is_crowded = !agents.ready.is_empty();
            if self.rule.is_crowded.swap(is_crowded, Ordering::Relaxed) != is_crowded && is_crowded {
                let awake = agents.known.values().filter(|agent| !agent.is_tied);
                awake.filter_map(|agent| agent.awake.as_ref()).for_each(|awake| awake.inbox.ring());
            }
            let left = agents.due.first().map(|(due, _)| due.saturating_sub(wall_clock()).max(0) as u64);
            // The clock of the system may be set.
            let left = left.map_or(LONGEST, |left| Duration::from_nanos(left).min(LONGEST));
            agents = self.changed.wait_timeout(agents, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        for agent in agents.known.values_mut() {
            let letters = agent.mailbox.take().map(|mailbox| mailbox.take()).unwrap_or_default();
            letters.into_iter().for_each(|letter| letter.answer(Err(AgentError::Leaving)));
        }
    }

    /// Gives places to those that wait for one, as far as there are some.
    fn give_places(self: &Arc<HostTable>, agents: &mut Agents) {
        while agents.awake - agents.tied < self.settings.awake
            && let Some(name) = agents.ready.pop_front()
        {
            self.give_place(agents, &name);
        }
    }

    /// Gives an agent a thread for its machine.
    fn give_place(self: &Arc<HostTable>, agents: &mut Agents, name: &Arc<str>) {
        let Some(agent) = agents.known.get_mut(name) else { return };
        if agent.standing != AgentStanding::Waiting {
            return;
        }
        if agent.stops {
            agents.set(name, AgentStanding::Stopped);
            return self.changed.notify_all();
        }
        let mailbox = agent.mailbox.get_or_insert_default().clone();
        let (shared, own) = (self.clone(), name.clone());
        let thread = std::thread::Builder::new().name("agent".into()).spawn(move || {
            let rest = run_agent(&shared, &own, &mailbox);
            shared.leave(&own, rest);
        });
        match thread {
            Ok(_) => {
                agents.awake += 1;
                agents.set(name, AgentStanding::Awake);
            }
            Err(error) => {
                let soon = wall_clock().saturating_add(RETRY.as_nanos() as i64);
                agents.set(name, AgentStanding::Failed(error.to_string(), Some(soon)));
            }
        }
    }

    /// Takes an agent's place from it, which rests from here on.
    fn leave(&self, name: &Arc<str>, rest: Result<RunRest, AgentError>) {
        let mut agents = self.agents();
        agents.awake -= 1;
        let Some(agent) = agents.known.get_mut(name) else { return };
        agent.awake = None;
        let was_tied = std::mem::take(&mut agent.is_tied);
        let has_letters = agent.mailbox.as_ref().is_some_and(|mailbox| !mailbox.is_empty());
        let stops = agent.stops;
        agent.failures = if rest.is_err() { agent.failures.saturating_add(1) } else { 0 };
        let failures = agent.failures;
        let mut report = None;
        // Some of them may have the addresses now.
        for other in std::mem::take(&mut agents.blocked) {
            if agents
                .known
                .get(&other)
                .is_some_and(|agent| matches!(agent.standing, AgentStanding::Failed(..)))
            {
                agents.set(&other, AgentStanding::Waiting);
            }
        }
        let standing = match rest {
            Ok(RunRest::Ended(status)) => AgentStanding::Ended(status),
            Ok(RunRest::Asleep(_)) if stops => AgentStanding::Stopped,
            Ok(RunRest::Asleep(_)) if has_letters => AgentStanding::Waiting,
            Ok(RunRest::Asleep(due)) => AgentStanding::Asleep(due),
            Err(error) => {
                let text = error.to_string();
                // A command may inspect the folder.
                let is_in_use = matches!(error, AgentError::Run(DurableError::InUse(_)));
                let is_blocked = matches!(error, AgentError::Run(DurableError::AddressesTaken));
                if is_blocked {
                    agents.blocked.push(name.clone());
                }
                if !is_in_use && !is_blocked || failures == 1 && is_in_use || failures == LETTER_TRIES {
                    report = Some(text.clone());
                }
                let pause = RETRY.saturating_mul(1 << failures.min(6)).as_nanos() as i64;
                let again = error.may_pass().then(|| wall_clock().saturating_add(pause));
                AgentStanding::Failed(text, again)
            }
        };
        let refusal = match &standing {
            AgentStanding::Ended(status) => Some(AgentError::Ended(*status)),
            AgentStanding::Stopped => Some(AgentError::Stopped),
            // The reason may pass, so letters wait for a while.
            AgentStanding::Failed(_, Some(_)) if failures < LETTER_TRIES => None,
            AgentStanding::Failed(reason, _) => Some(AgentError::Failed(reason.clone())),
            _ => None,
        };
        let Some(agent) = agents.known.get_mut(name) else { return };
        let mailbox = agent.mailbox.take_if(|_| refusal.is_some() || !has_letters);
        agents.tied -= usize::from(was_tied);
        agents.set(name, standing);
        self.changed.notify_all();
        drop(agents);
        if let (Some(refusal), Some(mailbox)) = (refusal, mailbox) {
            let text = refusal.to_string();
            let refuse = |letter: Letter| letter.answer(Err(AgentError::Refused(text.clone())));
            mailbox.take().into_iter().for_each(refuse);
        }
        if let Some(report) = report {
            self.report(name, &report);
        }
    }
}

/// Time after which an agent is tried again that could not go on, doubled with each failure.
const RETRY: Duration = Duration::from_millis(250);

/// Number of tries that have failed in a row, in about 16 seconds, after which letters are refused.
const LETTER_TRIES: u8 = 6;

/// Longest time between two looks at the clock.
const LONGEST: Duration = Duration::from_secs(60);
