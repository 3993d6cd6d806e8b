//! Rights: what of the outside a program may reach.
//!
//! A host grants rights to a whole run, and a form of the program narrows them for what it evaluates. Both
//! are [`Rights`], and what is asked for has to be in all of them.
//!
//! Guarantees: nothing is granted that was not named. Paths are compared as they are after all links and `..`
//! are followed ([`resolve`]).
//!
//! Not here: asking. The machine asks the host before each request that needs a right ([`Host::permit`]).
//!
//! [`Host::permit`]: super::Host::permit

use std::path::{Component, Path, PathBuf};

/// A kind of access to the outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Right {
    /// Reading files; the object is a path.
    Read,
    /// Writing, making, renaming and deleting files; the object is a path.
    Write,
    /// Talking over the network; the object is `HOST:PORT`.
    Net,
    /// Running other programs; the object is the name or the path of the program.
    Run,
    /// Reading variables of the environment; the object is a name.
    Env,
    /// Using serial ports; the object is a path.
    Serial,
    /// Reading modules that the program requires; the object is a path. It is not a right of its own: it
    /// comes with the folders of modules, or with [`Right::Read`].
    Module,
    /// Being an agent of a fleet, by the connections that the command was given; the object is the name of
    /// the fleet.
    Fleet,
}

impl Right {
    /// The rights that can be granted.
    pub const ALL: [Right; 7] =
        [Right::Read, Right::Write, Right::Net, Right::Run, Right::Env, Right::Serial, Right::Fleet];

    /// Returns its name, as in a flag: `read`.
    pub fn name(self) -> &'static str {
        match self {
            Right::Read | Right::Module => "read",
            Right::Write => "write",
            Right::Net => "net",
            Right::Run => "run",
            Right::Env => "env",
            Right::Serial => "serial",
            Right::Fleet => "fleet",
        }
    }

    /// Returns the right of this name.
    pub fn of_name(name: &str) -> Option<Right> {
        Right::ALL.into_iter().find(|right| right.name().eq_ignore_ascii_case(name))
    }

    /// Returns the flag of the commands that grants this right to this object.
    pub fn flag(self, object: &str) -> String {
        format!("--allow-{}={object}", self.name())
    }

    fn is_of_paths(self) -> bool {
        matches!(self, Right::Read | Right::Write | Right::Serial | Right::Module)
    }
}

/// The rights of a program; by default none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rights {
    /// Rights to everything of a kind.
    whole: Vec<Right>,
    /// Rights to single objects.
    single: Vec<(Right, String)>,
    /// Folders of modules.
    modules: Vec<String>,
}

impl Rights {
    /// Returns no rights.
    pub fn none() -> Rights {
        Rights::default()
    }

    /// Returns all rights.
    pub fn all() -> Rights {
        Rights { whole: Right::ALL.to_vec(), ..Rights::default() }
    }

    /// Adds a right to one object, or for a path to all that is below it.
    #[must_use]
    pub fn with(mut self, right: Right, object: impl Into<String>) -> Rights {
        self.single.push((right, object.into()));
        self
    }

    /// Adds a right to all objects.
    #[must_use]
    pub fn with_all(mut self, right: Right) -> Rights {
        self.whole.push(right);
        self
    }

    /// Adds the right to read the modules in a folder.
    #[must_use]
    pub fn with_modules(mut self, folder: impl Into<String>) -> Rights {
        self.modules.push(folder.into());
        self
    }

    /// Adds the rights of `other`.
    #[must_use]
    pub fn and(mut self, other: Rights) -> Rights {
        self.whole.extend(other.whole);
        self.single.extend(other.single);
        self.modules.extend(other.modules);
        self
    }

    /// Takes a right away, with all that it was granted for.
    #[must_use]
    pub fn without(mut self, right: Right) -> Rights {
        self.whole.retain(|&other| other != right);
        self.single.retain(|&(other, _)| other != right);
        self
    }

    /// Returns these rights one by one, each with its object, or without one for all objects.
    pub fn parts(&self) -> impl Iterator<Item = (Right, Option<&str>)> {
        let whole = self.whole.iter().map(|&right| (right, None));
        whole.chain(self.single.iter().map(|(right, object)| (*right, Some(&**object))))
    }

    /// Returns whether these contain the right to an object, which for a path is `object` after following
    /// links; `follow` does that.
    pub(super) fn contain(&self, right: Right, object: &str, follow: &dyn Fn(&str) -> PathBuf) -> bool {
        if right == Right::Module {
            return self.contain_module(object, follow) || self.contain(Right::Read, object, follow);
        }
        if self.whole.contains(&right) {
            return true;
        }
        let mut grants = self.single.iter().filter(|&&(other, _)| other == right).map(|(_, object)| object);
        match right {
            Right::Net => grants.any(|grant| is_address_in(object, grant)),
            Right::Run if object.contains('/') => {
                let path = follow(object);
                grants.any(|grant| grant.contains('/') && follow(grant) == path)
            }
            Right::Run | Right::Env => grants.any(|grant| grant == object),
            Right::Fleet => grants.any(|grant| grant.eq_ignore_ascii_case(object)),
            Right::Read | Right::Write | Right::Serial | Right::Module => {
                grants.any(|grant| Path::new(object).starts_with(follow(grant)))
            }
        }
    }

    fn contain_module(&self, path: &str, follow: &dyn Fn(&str) -> PathBuf) -> bool {
        let path = Path::new(path);
        let is_module = path.extension().is_some_and(|extension| extension == "esl" || extension == "eslb");
        is_module && self.modules.iter().any(|folder| path.starts_with(follow(folder)))
    }
}

/// Returns whether an address is granted by `grant`, which is an address or a host, with any port.
fn is_address_in(address: &str, grant: &str) -> bool {
    if address.eq_ignore_ascii_case(grant) {
        return true;
    }
    // A host in brackets has colons of its own.
    let Some((host, _)) = address.rsplit_once(':') else { return false };
    host.eq_ignore_ascii_case(grant)
}

/// Answer of a host that was asked for a right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Permit {
    /// It is granted. To be used in place of the object: for a path the one that was compared, so that no
    /// link that is put there now leads elsewhere.
    Granted(String),
    /// The run does not have it.
    NotGranted,
    /// The run has it, but not what the program evaluates at present.
    Narrowed,
}

/// Answers for a host that grants `rights`, where `narrowed` are in force.
pub(super) fn permit(
    rights: &Rights,
    narrowed: &[Rights],
    right: Right,
    object: &str,
    follow: &dyn Fn(&str) -> PathBuf,
) -> Permit {
    let whole = if right.is_of_paths() {
        match follow(object).into_os_string().into_string() {
            Ok(path) => path,
            // No grant is written so.
            Err(_) => return Permit::NotGranted,
        }
    } else {
        object.to_owned()
    };
    if !rights.contain(right, &whole, follow) {
        return Permit::NotGranted;
    }
    let is_module = right == Right::Module && rights.contain_module(&whole, follow);
    if is_module || narrowed.iter().all(|narrowed| narrowed.contain(right, &whole, follow)) {
        Permit::Granted(whole)
    } else {
        Permit::Narrowed
    }
}

/// Most links that are followed in one path.
const MOST_LINKS: usize = 40;

/// Returns the absolute path to which `path` leads when all its links and dots are followed, also where
/// nothing is there yet.
pub(super) fn resolve(path: &str) -> PathBuf {
    let given = Path::new(path);
    let mut resolved = if given.is_absolute() {
        PathBuf::from("/")
    } else {
        std::env::current_dir().and_then(|folder| folder.canonicalize()).unwrap_or_else(|_| "/".into())
    };
    // The parts still to be followed, the next one last.
    let parts = |path: &Path| -> Vec<PathBuf> {
        path.components().rev().map(|part| PathBuf::from(part.as_os_str())).collect()
    };
    let mut rest = parts(given);
    let mut links = 0;
    while let Some(part) = rest.pop() {
        match part.components().next() {
            Some(Component::ParentDir) => _ = resolved.pop(),
            Some(Component::Normal(name)) => {
                let next = resolved.join(name);
                match std::fs::read_link(&next) {
                    Ok(target) if links < MOST_LINKS => {
                        links += 1;
                        rest.extend(parts(&target));
                    }
                    // It is not a link, or nothing is there; or the system will refuse so many links.
                    _ => resolved = next,
                }
            }
            Some(Component::CurDir) | None => {}
            Some(root @ (Component::RootDir | Component::Prefix(_))) => {
                resolved = Path::new(root.as_os_str()).to_path_buf();
            }
        }
    }
    resolved
}

/// Returns `path` without dots, as far as its text tells: for hosts whose files are in memory.
pub(super) fn resolve_as_text(path: &str) -> PathBuf {
    let mut resolved = PathBuf::new();
    for part in Path::new(path).components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => _ = resolved.pop(),
            part => resolved.push(part),
        }
    }
    resolved
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(rights: &Rights, right: Right, object: &str) -> bool {
        matches!(permit(rights, &[], right, object, &resolve_as_text), Permit::Granted(_))
    }

    #[test]
    fn nothing_is_granted_that_was_not_named() {
        for right in Right::ALL {
            assert!(!check(&Rights::none(), right, "x"));
            assert!(check(&Rights::all(), right, "x"));
            assert!(check(&Rights::none().with(right, "x"), right, "x"));
            assert!(!check(&Rights::none().with(right, "x"), right, "xy"));
            assert!(!check(&Rights::all().without(right), right, "x"));
            assert_eq!(Right::of_name(right.name()), Some(right));
        }
        assert_eq!(Right::Env.flag("HOME"), "--allow-env=HOME");
    }

    #[test]
    fn a_path_is_granted_with_all_below_it() {
        let rights = Rights::none().with(Right::Read, "/data/./logs");
        assert!(check(&rights, Right::Read, "/data/logs"));
        assert!(check(&rights, Right::Read, "/data/logs/x/../y"));
        assert!(!check(&rights, Right::Read, "/data/logs/../x"));
        assert!(!check(&rights, Right::Read, "/data/logsx"));
        assert!(!check(&rights, Right::Write, "/data/logs/x"));
    }

    #[test]
    fn an_address_is_granted_by_itself_or_its_host() {
        let rights = Rights::none().with(Right::Net, "Example.com").with(Right::Net, "[::1]:80");
        assert!(check(&rights, Right::Net, "example.com:443"));
        assert!(check(&rights, Right::Net, "[::1]:80"));
        assert!(!check(&rights, Right::Net, "[::1]:81"));
        assert!(!check(&rights, Right::Net, "www.example.com:443"));
    }

    #[test]
    fn a_program_is_granted_by_the_name_under_which_it_is_called() {
        let rights = Rights::none().with(Right::Run, "ls").with(Right::Run, "/bin/cat");
        assert!(check(&rights, Right::Run, "ls") && check(&rights, Right::Run, "/bin/./cat"));
        assert!(!check(&rights, Right::Run, "./ls") && !check(&rights, Right::Run, "cat"));
    }

    #[test]
    fn narrowing_takes_away_and_modules_stay() {
        let rights = Rights::none().with(Right::Read, "a").with_modules("lib");
        let narrowed = [Rights::all(), Rights::none().with(Right::Read, "a/b")];
        let ask = |right, path| permit(&rights, &narrowed, right, path, &resolve_as_text);
        assert_eq!(ask(Right::Read, "a/b/c"), Permit::Granted("a/b/c".into()));
        assert_eq!(ask(Right::Read, "a/c"), Permit::Narrowed);
        assert_eq!(ask(Right::Read, "c"), Permit::NotGranted);
        assert_eq!(ask(Right::Module, "lib/x.esl"), Permit::Granted("lib/x.esl".into()));
        assert_eq!(ask(Right::Module, "lib/x.txt"), Permit::NotGranted);
        assert_eq!(ask(Right::Read, "lib/x.esl"), Permit::NotGranted);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_dots_are_followed_also_to_what_is_not_there() {
        let folder = std::env::temp_dir().join(format!("esl-rights-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("inside")).unwrap();
        let folder = folder.canonicalize().unwrap();
        for (link, target) in [("inside/out", "../other"), ("inside/loop", "loop"), ("inside/up", "..")] {
            std::os::unix::fs::symlink(target, folder.join(link)).unwrap();
        }
        let at = |path: &str| resolve(folder.join(path).to_str().unwrap());
        assert_eq!(at("inside/new/../x"), folder.join("inside/x"));
        assert_eq!(at("inside/out/x"), folder.join("other/x"), "a link to what is not there");
        assert_eq!(at("inside/up/inside/up/x"), folder.join("x"));
        assert_eq!(at("inside/out/../x"), folder.join("x"), "dots after a link are those of its target");
        assert_eq!(at("inside/loop/x"), folder.join("inside/loop/x"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
