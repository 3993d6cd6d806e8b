//! The captures of closures.
//!
//! Closures are flat: the code that makes one must have all that it captures. So a capture belongs to every
//! lambda between the code that refers to a variable and the frame that owns it.

use rustc_hash::FxHashMap;

use crate::core::*;

/// Something that lives in a register and can be captured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Lexical {
    /// A variable, or a local function.
    Variable(VarId),
    /// The tag of the catch of a block.
    Block(BlockId),
    /// The tag of the catch of a tagbody.
    Tagbody(TagbodyId),
}

impl Lexical {
    /// Returns the lambda in which it is bound.
    pub(crate) fn owner(self, core: &Core) -> LambdaId {
        match self {
            Lexical::Variable(variable) => core.variables[variable.index()].owner,
            Lexical::Block(block) => core.blocks[block.index()].owner,
            Lexical::Tagbody(tagbody) => core.tagbodies[tagbody.index()].owner,
        }
    }
}

/// The captures of every lambda.
#[derive(Debug)]
pub(super) struct Captures {
    /// Frame in which the closure of each lambda is made.
    parents: Vec<Option<LambdaId>>,
    of: Vec<Vec<Lexical>>,
    indexes: FxHashMap<(LambdaId, Lexical), usize>,
    captured: Vec<bool>,
}

impl Captures {
    pub(super) fn new(core: &Core) -> Captures {
        Captures {
            parents: vec![None; core.lambdas.len()],
            of: vec![Vec::new(); core.lambdas.len()],
            indexes: FxHashMap::default(),
            captured: vec![false; core.variables.len()],
        }
    }

    /// Sets the frame in which the closure of `lambda` is made.
    pub(super) fn set_parent(&mut self, lambda: LambdaId, parent: LambdaId) {
        self.parents[lambda.index()] = Some(parent);
    }

    /// Returns the captures of a lambda, in order.
    pub(super) fn of(&self, lambda: LambdaId) -> &[Lexical] {
        &self.of[lambda.index()]
    }

    /// Returns the index of a capture.
    pub(super) fn index(&self, lambda: LambdaId, lexical: Lexical) -> Option<usize> {
        self.indexes.get(&(lambda, lexical)).copied()
    }

    /// Whether any lambda captures the variable.
    pub(super) fn is_captured(&self, variable: VarId) -> bool {
        self.captured[variable.index()]
    }

    /// Notes that code in the frame `user` refers to `lexical`, which the frame `home` owns. Calls `first`
    /// with each lambda that captured nothing before.
    pub(super) fn add(
        &mut self,
        lexical: Lexical,
        home: LambdaId,
        user: LambdaId,
        first: &mut dyn FnMut(LambdaId),
    ) {
        let mut frame = user;
        while frame != home {
            let captures = &mut self.of[frame.index()];
            if self.indexes.contains_key(&(frame, lexical)) {
                // The lambdas further out capture it too.
                return;
            }
            self.indexes.insert((frame, lexical), captures.len());
            captures.push(lexical);
            if captures.len() == 1 {
                first(frame);
            }
            if let Lexical::Variable(variable) = lexical {
                self.captured[variable.index()] = true;
            }
            let Some(parent) = self.parents[frame.index()] else {
                unreachable!("references to a variable lie inside the lambda that owns it");
            };
            frame = parent;
        }
    }

    /// Adds the captures of local functions. A function that captures nothing is a constant and is never
    /// captured. A function that refers to one that captures something captures that function, and is not a
    /// constant either.
    pub(super) fn add_functions(
        &mut self,
        core: &Core,
        frames: &[LambdaId],
        functions: &FxHashMap<VarId, LambdaId>,
        references: &[(VarId, LambdaId)],
    ) {
        let mut users: FxHashMap<VarId, Vec<LambdaId>> = FxHashMap::default();
        for &(function, user) in references {
            users.entry(function).or_default().push(user);
        }
        let names: FxHashMap<LambdaId, VarId> =
            functions.iter().map(|(&name, &lambda)| (lambda, name)).collect();
        let mut pending: Vec<VarId> = functions
            .iter()
            .filter(|(_, lambda)| !self.of(**lambda).is_empty())
            .map(|(&name, _)| name)
            .collect();
        // The order of a hash table must not affect the code.
        pending.sort_unstable();
        while let Some(function) = pending.pop() {
            let home = frames[core.variables[function.index()].owner.index()];
            for &user in users.get(&function).map_or(&[][..], Vec::as_slice) {
                let mut first = |lambda| pending.extend(names.get(&lambda));
                self.add(Lexical::Variable(function), home, user, &mut first);
            }
        }
    }
}
