//! The answer of the commands to `--version`.

/// Returns the version of a command with how it was built: profile, target, and which of these features of
/// cargo it has.
///
/// ```
/// let text = esl_command::version_of_build("0.1.0", &[("native", true), ("robots", false)]);
/// let lines: Vec<&str> = text.lines().collect();
/// assert_eq!(lines[0], "0.1.0");
/// assert!(lines[1].starts_with("profile: ") && lines[2].starts_with("target: "));
/// assert_eq!(lines[3], "features: native");
/// ```
pub fn version_of_build(version: &str, features: &[(&str, bool)]) -> String {
    let names: Vec<&str> = features.iter().filter(|(_, is_on)| *is_on).map(|(name, _)| *name).collect();
    let names = if names.is_empty() { "none".into() } else { names.join(", ") };
    let (profile, target) = (env!("ESL_PROFILE"), env!("ESL_TARGET"));
    format!("{version}\nprofile: {profile}\ntarget: {target}\nfeatures: {names}")
}
