//! Types by the names that they have in ROS, those of the services and messages too of which an action
//! consists.

use std::sync::Arc;

use esl_host::HostFailure;

use crate::message::{ActionType, MessageType, ServiceType, Types};

/// Returns the action and the rest of a name such as `nav2_msgs/action/NavigateToPose_SendGoal`.
fn action_in<'a>(types: &Types, name: &'a str) -> Result<Option<(Arc<ActionType>, &'a str)>, HostFailure> {
    if name.split('/').nth(1) != Some("action") {
        return Ok(None);
    }
    let base = name.rfind('/').map_or(0, |at| at + 1);
    let Some(at) = name[base..].find('_').map(|at| base + at) else { return Ok(None) };
    Ok(Some((types.action(&name[..at])?, &name[at + 1..])))
}

/// Returns the type of services of this name.
///
/// # Errors
/// `:unknown-type`, `:invalid-definition`.
pub(super) fn service(types: &Types, name: &str) -> Result<Arc<ServiceType>, HostFailure> {
    match action_in(types, name)? {
        Some((action, "SendGoal")) => Ok(action.send_goal.clone()),
        Some((action, "GetResult")) => Ok(action.get_result.clone()),
        _ => Ok(types.service(name)?),
    }
}

/// Returns the type of messages of this name.
///
/// # Errors
/// `:unknown-type`, `:invalid-definition`.
pub(super) fn message(types: &Types, name: &str) -> Result<Arc<MessageType>, HostFailure> {
    let Some((action, part)) = action_in(types, name)? else { return Ok(types.message(name)?) };
    Ok(match part {
        "SendGoal_Request" => action.send_goal.request.clone(),
        "SendGoal_Response" => action.send_goal.response.clone(),
        "GetResult_Request" => action.get_result.request.clone(),
        "GetResult_Response" => action.get_result.response.clone(),
        "FeedbackMessage" => action.feedback_message.clone(),
        _ => types.message(name)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_actions_have_their_names() {
        let types = Types::bundled();
        for name in ["SendGoal", "GetResult"] {
            let name = format!("action_tutorials_interfaces/action/Fibonacci_{name}");
            let found = service(&types, &name).expect("it is a part of an action");
            assert_eq!(found.name(), name);
            for part in ["Request", "Response"] {
                let name = format!("{name}_{part}");
                assert_eq!(message(&types, &name).expect("it is a message").name(), name);
            }
        }
        let name = "action_tutorials_interfaces/action/Fibonacci_FeedbackMessage";
        assert_eq!(message(&types, name).expect("it is a message").name(), name);
        assert!(message(&types, "action_tutorials_interfaces/action/Fibonacci_Status").is_err());
        assert_eq!(
            service(&types, "std_srvs/srv/Empty").expect("it is a service").name(),
            "std_srvs/srv/Empty"
        );
        assert!(service(&types, "std_srvs/srv/Nothing").is_err());
    }
}
