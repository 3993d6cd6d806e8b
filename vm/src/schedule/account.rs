//! Accounts of ticks: budgets of forms and of tasks.
//!
//! A form with a budget opens an account under that of its task, and tasks made inside charge it too, so
//! nobody gains ticks by making tasks. When it is spent, the form ends, and so do tasks made inside that
//! outlive its owner; the account of a task's own budget has no form, and ends all tasks that charge it.

use crate::task::{AccountId, LimitNumber, TaskIndex};

/// Subject of an account: it ends when the account is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AccountOwner {
    /// The form of the limit with this number, in the task with this index.
    Form(TaskIndex, LimitNumber),
    /// All tasks that charge it.
    Tasks,
    /// Nothing: the form was left before the account was spent.
    Nobody,
}

/// Ticks that may be used together.
#[derive(Clone, Debug)]
pub(crate) struct Account {
    /// Ticks left; negative once it is overdrawn.
    left: i64,
    /// Account that is charged too.
    parent: AccountId,
    /// Number of tasks and accounts that charge it, and of the open form.
    users: u32,
    /// Subject, which ends when the account is spent.
    owner: AccountOwner,
}

/// The accounts of a machine.
#[derive(Default)]
pub(crate) struct Accounts {
    pub(crate) accounts: Vec<Account>,
    /// Indices of accounts that are gone.
    pub(crate) free: Vec<u32>,
}

impl Accounts {
    fn get(&self, id: AccountId) -> Option<&Account> {
        self.accounts.get(id.0 as usize)
    }

    fn get_mut(&mut self, id: AccountId) -> Option<&mut Account> {
        self.accounts.get_mut(id.0 as usize)
    }

    /// Opens an account under `parent`, with one user.
    pub(crate) fn open(&mut self, parent: AccountId, ticks: u64, owner: AccountOwner) -> AccountId {
        self.enter(parent);
        let left = i64::try_from(ticks).unwrap_or(i64::MAX);
        let account = Account { left, parent, users: 1, owner };
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

    /// Closes the account of a form that is left, and returns the account above it. `None` if there is no
    /// such account.
    pub(crate) fn close_form(&mut self, id: AccountId) -> Option<AccountId> {
        let account = self.get_mut(id)?;
        // Tasks made inside that have not had their turn since it was spent are still to end.
        account.owner = if account.left > 0 { AccountOwner::Nobody } else { AccountOwner::Tasks };
        // The task never ceased to be a user of the account above.
        let parent = account.parent;
        self.leave(id);
        Some(parent)
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
            self.free.push(id.0);
            id = parent;
        }
    }

    /// Charges ticks to an account and those above it, and returns the limits that expire by it.
    pub(crate) fn charge(&mut self, id: AccountId, ticks: u64) -> Vec<(TaskIndex, LimitNumber)> {
        let mut expired = Vec::new();
        let mut id = id;
        while let Some(account) = self.get_mut(id) {
            let was_left = account.left > 0;
            account.left = account.left.saturating_sub_unsigned(ticks);
            if was_left
                && account.left <= 0
                && let AccountOwner::Form(task, limit) = account.owner
            {
                expired.push((task, limit));
            }
            id = account.parent;
        }
        expired
    }

    /// Returns whether the task with this index, which charges `id`, has to end because an account is spent.
    pub(crate) fn is_spent_for(&self, id: AccountId, task: TaskIndex) -> bool {
        let mut id = id;
        while let Some(account) = self.get(id) {
            if account.left <= 0 {
                match account.owner {
                    AccountOwner::Tasks => return true,
                    AccountOwner::Form(owner, _) if owner != task => return true,
                    _ => {}
                }
            }
            id = account.parent;
        }
        false
    }

    /// Calls `visit` with the ticks left of an account and of those above it, where their end would end
    /// something.
    pub(crate) fn visit_left(&self, id: AccountId, visit: &mut dyn FnMut(u64)) {
        let mut id = id;
        while let Some(account) = self.get(id) {
            if account.owner != AccountOwner::Nobody {
                visit(account.left as u64);
            }
            id = account.parent;
        }
    }

    /// Returns the ticks that may be used before one of these accounts is spent.
    pub(crate) fn left(&self, id: AccountId) -> u64 {
        let (mut id, mut least) = (id, i64::MAX);
        while let Some(account) = self.get(id) {
            if account.owner != AccountOwner::Nobody && account.left > 0 {
                least = least.min(account.left);
            }
            id = account.parent;
        }
        least as u64
    }
}
