//! Accounts of ticks: budgets of forms and of tasks.

use crate::task::AccountId;

/// Ticks that may be used together.
#[derive(Clone, Debug)]
pub(crate) struct Account {
    pub(crate) left: i64,
    pub(crate) parent: AccountId,
    /// Tasks and accounts that charge it, and the open form.
    pub(crate) users: u32,
    pub(crate) status: Status,
}

/// Who ends when an account is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    /// The form with the limit of this number, of the task at this place.
    Form(u32, u64),
    /// All tasks that charge it.
    Tasks,
    /// Nobody: its form was left before it was spent.
    Closed,
}

/// The accounts of a machine.
#[derive(Default)]
pub(crate) struct Accounts {
    accounts: Vec<Account>,
    free: Vec<u32>,
}

impl Accounts {
    pub(crate) fn get(&self, id: AccountId) -> Option<&Account> {
        self.accounts.get(id.0 as usize)
    }

    pub(crate) fn get_mut(&mut self, id: AccountId) -> Option<&mut Account> {
        self.accounts.get_mut(id.0 as usize)
    }

    pub(crate) fn open(&mut self, parent: AccountId, ticks: u64, status: Status) -> AccountId {
        self.enter(parent);
        let left = i64::try_from(ticks).unwrap_or(i64::MAX);
        let account = Account { left, parent, users: 1, status };
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

    /// Opens an account for a task with a budget of its own.
    pub(crate) fn open_for_task(&mut self, parent: AccountId, ticks: u64) -> AccountId {
        self.open(parent, ticks, Status::Tasks)
    }

    /// Adds a user.
    pub(crate) fn enter(&mut self, id: AccountId) {
        if let Some(account) = self.get_mut(id) {
            account.users += 1;
        }
    }

    /// Takes a user away; one that nobody uses is gone.
    pub(crate) fn leave(&mut self, id: AccountId) {
        let mut id = id;
        while let Some(account) = self.get_mut(id) {
            account.users -= 1;
            if account.users > 0 {
                return;
            }
            let parent = account.parent;
            self.free.push(id.0);
            id = parent;
        }
    }

    /// Calls `visit` with the ticks that are left of an account and of those above it, as far as they matter.
    pub(crate) fn visit_left(&self, id: AccountId, visit: &mut dyn FnMut(u64)) {
        let mut id = id;
        while let Some(account) = self.get(id) {
            if account.status != Status::Closed {
                visit(account.left as u64);
            }
            id = account.parent;
        }
    }

    /// The ticks that may be used before one of these accounts is spent.
    pub(crate) fn left(&self, id: AccountId) -> u64 {
        let (mut id, mut least) = (id, i64::MAX);
        while let Some(account) = self.get(id) {
            if account.status != Status::Closed && account.left > 0 {
                least = least.min(account.left);
            }
            id = account.parent;
        }
        least as u64
    }
}
