//! Accounts of ticks and of other measures: budgets and quotas of forms, budgets of tasks.
//!
//! A form with a budget opens an account under that of its task, and tasks made inside charge it too, so
//! making tasks gains no ticks. When it is spent, the form ends, and so do tasks made inside that
//! outlive its owner; the account of a task's own budget has no form, and ends all tasks that charge it.
//!
//! Each account is of one measure, and what is charged passes by those of another one.

use crate::task::{AccountId, LimitNumber, TaskIndex};
use esl_heap::list_state;
use esl_heap::state::{StateSink, Stated};
use esl_heap::{stored, stored_enum};

/// Subject of an account: it ends when the account is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AccountOwner {
    /// The form of the limit with this number, in the task with this index.
    Form(TaskIndex, LimitNumber),
    /// All tasks that charge it.
    Tasks,
    /// Nothing: the form was left before the account was spent.
    None,
}

/// The unit that an account counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    /// Ticks used.
    Ticks,
    /// Bytes allocated.
    Bytes,
    /// Tasks of the program that have not ended.
    Tasks,
    /// Operations begun.
    Operations,
}

/// How much an account allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Amount {
    /// The counted unit.
    pub measure: Measure,
    /// How many of it.
    pub units: u64,
    /// Whether it is a quota, and not a budget.
    pub is_quota: bool,
}

impl Amount {
    /// Returns a budget of ticks.
    pub(crate) fn budget(ticks: u64) -> Amount {
        Amount { measure: Measure::Ticks, units: ticks, is_quota: false }
    }
}

/// Ticks, or units of another measure, that may be used together.
#[derive(Clone, Debug)]
pub(crate) struct Account {
    /// The counted unit.
    measure: Measure,
    /// Units left; negative once it is overdrawn.
    left: i64,
    /// Whether its subject ends: none were left at some moment, or one more was wanted than there are.
    is_spent: bool,
    /// Whether it is a quota's, so that tasks it ends count as aborted, and not as failed.
    is_quota: bool,
    /// Account that is charged too.
    parent: AccountId,
    /// Number of tasks and accounts that charge it, and of the open form.
    users: u32,
    /// Subject, which ends when the account is spent.
    owner: AccountOwner,
}

list_state! { Account {
    measure: Run by |&measure: &Measure, sink: &mut dyn StateSink| sink.word(measure as u64),
    left: Run,
    is_spent: Run,
    is_quota: Run,
    parent: Run,
    users: Run,
    owner: Run,
} }

impl Stated for AccountOwner {
    fn tell(&self, sink: &mut dyn StateSink) {
        match self {
            AccountOwner::Form(task, limit) => (*task, *limit).tell(sink),
            AccountOwner::Tasks => sink.word(1),
            AccountOwner::None => sink.word(2),
        }
    }
}

impl Account {
    /// Has the subject end, and adds the limit to `expired` that does it.
    fn spend(&mut self, expired: &mut Vec<(TaskIndex, LimitNumber)>) {
        if !std::mem::replace(&mut self.is_spent, true)
            && let AccountOwner::Form(task, limit) = self.owner
        {
            expired.push((task, limit));
        }
    }

    /// Returns whether the task with this index, which charges it, has to end because it is spent.
    fn ends(&self, task: TaskIndex) -> bool {
        self.is_spent
            && match self.owner {
                AccountOwner::Tasks => true,
                AccountOwner::Form(owner, _) => owner != task,
                AccountOwner::None => false,
            }
    }
}

/// The accounts of a machine.
#[derive(Clone, Default)]
pub(crate) struct Accounts {
    pub(crate) accounts: Vec<Account>,
    /// Indices of accounts that are gone.
    pub(crate) free: Vec<u32>,
    /// Number of accounts that count bytes.
    pub(crate) bytes_counted: u32,
}

impl Accounts {
    fn get(&self, id: AccountId) -> Option<&Account> {
        self.accounts.get(id.0 as usize)
    }

    fn get_mut(&mut self, id: AccountId) -> Option<&mut Account> {
        self.accounts.get_mut(id.0 as usize)
    }

    /// Opens an account under `parent`, with one user.
    pub(crate) fn open(&mut self, parent: AccountId, amount: Amount, owner: AccountOwner) -> AccountId {
        let Amount { measure, units, is_quota } = amount;
        self.enter(parent);
        // Bytes are counted when they have been allocated, so all of them may be.
        let units = units.saturating_add(u64::from(measure == Measure::Bytes));
        let left = i64::try_from(units).unwrap_or(i64::MAX);
        self.bytes_counted += u32::from(measure == Measure::Bytes);
        let is_spent = measure == Measure::Ticks && left == 0;
        let account = Account { measure, left, is_spent, is_quota, parent, users: 1, owner };
        match self.free.pop() {
            Some(index) => {
                self.accounts[index as usize] = account;
                AccountId(index)
            }
            None => {
                self.accounts.push(account);
                AccountId(self.accounts.len() as u32 - 1)
            }
        }
    }

    /// Closes the account of a form that is left. Returns whether there is such an account. The task never
    /// ceased to be a user of the one that it charged before.
    pub(crate) fn close_form(&mut self, id: AccountId) -> bool {
        let Some(account) = self.get_mut(id) else { return false };
        // Tasks made inside that have not had their turn since it was spent are still to end.
        account.owner = if account.is_spent { AccountOwner::Tasks } else { AccountOwner::None };
        self.leave(id);
        true
    }

    /// Adds a user.
    pub(crate) fn enter(&mut self, id: AccountId) {
        if let Some(account) = self.get_mut(id) {
            account.users += 1;
        }
    }

    /// Removes a user. An account without users is gone.
    pub(crate) fn leave(&mut self, id: AccountId) {
        let mut id = id;
        while let Some(account) = self.get_mut(id) {
            account.users -= 1;
            if account.users > 0 {
                return;
            }
            let parent = account.parent;
            self.bytes_counted -= u32::from(account.measure == Measure::Bytes);
            self.free.push(id.0);
            id = parent;
        }
    }

    /// Charges ticks or bytes to the accounts of this measure among this one and those above it, and returns
    /// the limits that expire by it.
    pub(crate) fn charge(
        &mut self,
        id: AccountId,
        measure: Measure,
        units: u64,
    ) -> Vec<(TaskIndex, LimitNumber)> {
        let mut expired = Vec::new();
        self.each_of(id, measure, |account| {
            account.left = account.left.saturating_sub_unsigned(units);
            if account.left <= 0 {
                account.spend(&mut expired);
            }
        });
        expired
    }

    /// Returns whether a unit more of a measure may be taken, and if not, the limits that expire by it. A
    /// second request may take it: the task first has to end forms that its accounts cannot end at once.
    pub(crate) fn admit(
        &mut self,
        id: AccountId,
        measure: Measure,
    ) -> Result<(), Vec<(TaskIndex, LimitNumber)>> {
        let (mut admits, mut expired) = (true, Vec::new());
        self.each_of(id, measure, |account| {
            if account.left <= 0 && !account.is_spent && account.owner != AccountOwner::None {
                account.spend(&mut expired);
                admits = false;
            }
        });
        if admits { Ok(()) } else { Err(expired) }
    }

    /// Takes a unit of a measure.
    pub(crate) fn take(&mut self, id: AccountId, measure: Measure) {
        self.each_of(id, measure, |account| account.left = account.left.saturating_sub(1));
    }

    /// Gives back a unit that was taken.
    pub(crate) fn give_back(&mut self, id: AccountId, measure: Measure) {
        self.each_of(id, measure, |account| account.left = account.left.saturating_add(1));
    }

    /// Calls `act` with the accounts of a measure among this one and those above it.
    fn each_of(&mut self, id: AccountId, measure: Measure, mut act: impl FnMut(&mut Account)) {
        let mut id = id;
        while let Some(account) = self.get_mut(id) {
            if account.measure == measure {
                act(account);
            }
            id = account.parent;
        }
    }

    /// Returns whether any account counts bytes.
    pub(crate) fn count_bytes(&self) -> bool {
        self.bytes_counted > 0
    }

    /// Returns whether the task with this index, which charges `id`, has to end because an account is spent.
    pub(crate) fn is_spent_for(&self, id: AccountId, task: TaskIndex) -> bool {
        self.outermost_spent(id, task).is_some()
    }

    /// Returns whether it is a quota for which the task has to end, and not a budget.
    pub(crate) fn is_quota_spent_for(&self, id: AccountId, task: TaskIndex) -> bool {
        self.outermost_spent(id, task).is_some_and(|account| account.is_quota)
    }

    /// Returns the outermost account that ends the task with this index, which charges `id`.
    fn outermost_spent(&self, id: AccountId, task: TaskIndex) -> Option<&Account> {
        let (mut id, mut found) = (id, None);
        while let Some(account) = self.get(id) {
            if account.ends(task) {
                found = Some(account);
            }
            id = account.parent;
        }
        found
    }

    /// Returns the account that a task charges whose maker charges `id`: that one, or if it is to be free of
    /// accounts that are spent, the first above all of them.
    pub(crate) fn for_child(&self, id: AccountId, is_free: bool) -> AccountId {
        let (mut above, mut next) = (id, id);
        while let Some(account) = self.get(next).filter(|_| is_free) {
            next = account.parent;
            if account.is_spent {
                above = next;
            }
        }
        above
    }

    /// Calls `visit` with the units left of an account and of those above it, where their end would end
    /// something.
    pub(crate) fn visit_left(&self, id: AccountId, visit: &mut dyn FnMut(u64)) {
        let mut id = id;
        while let Some(account) = self.get(id) {
            if account.owner != AccountOwner::None {
                visit(account.left as u64 ^ u64::from(account.is_spent) << 63);
            }
            id = account.parent;
        }
    }

    /// Returns the ticks that may be used before one of these accounts is spent.
    pub(crate) fn left(&self, id: AccountId) -> u64 {
        let (mut id, mut least) = (id, i64::MAX);
        while let Some(account) = self.get(id) {
            if account.measure == Measure::Ticks && account.owner != AccountOwner::None && account.left > 0 {
                least = least.min(account.left);
            }
            id = account.parent;
        }
        least as u64
    }
}

stored_enum! { AccountOwner { Form(task, limit) = 0, Tasks = 1, None = 2 } }
stored_enum! { Measure { Ticks = 0, Bytes = 1, Tasks = 2, Operations = 3 } }
stored! { Account { measure, left, is_spent, is_quota, parent, users, owner } }
stored! { Accounts { accounts, free, bytes_counted } }
