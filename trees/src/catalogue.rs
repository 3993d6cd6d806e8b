//! The nodes of BehaviorTree.CPP and of Nav2, one row for each.

/// Kind of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum BehaviourKind {
    Sequence,
    SequenceWithMemory,
    Fallback,
    Parallel,
    ParallelAll,
    ReactiveSequence,
    ReactiveFallback,
    IfThenElse,
    WhileDoElse,
    /// With this many cases.
    Switch(usize),
    TryCatch,
    Inverter,
    Retry,
    Repeat,
    Timeout,
    Delay,
    ForceSuccess,
    ForceFailure,
    KeepRunning,
    RunOnce,
    Precondition,
    Loop,
    BlackboardCheck,
    SkipUnlessUpdated,
    WaitValueUpdated,
    SubTree,
    AlwaysSuccess,
    AlwaysFailure,
    Script,
    ScriptCondition,
    SetBlackboard,
    UnsetBlackboard,
    Sleep,
    Pipeline,
    Recovery,
    RoundRobin,
    Nonblocking,
    Persistent,
    RateController,
    DistanceController,
    SpeedController,
    GoalUpdatedController,
    GoalUpdater,
    SingleTrigger,
    PathLonger,
    /// Declared by the file, with meanings that it does not have.
    CustomDecorator,
    CustomControl,
    Action,
    /// An action that ends within its tick.
    SyncAction,
    Condition,
}

impl BehaviourKind {
    /// Returns whether nodes of this kind are leaves that the program supplies.
    pub(crate) fn is_leaf(self) -> bool {
        matches!(self, BehaviourKind::Action | BehaviourKind::SyncAction | BehaviourKind::Condition)
    }
}

/// Direction of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    In,
    Out,
    Both,
}

/// Row of a node, by its name.
pub(crate) struct NodeRow {
    pub(crate) name: &'static str,
    pub(crate) kind: BehaviourKind,
    /// Least and greatest number of children.
    pub(crate) children: (usize, usize),
    /// Ports: `name!` is needed, `>name` is an output, `*name` both, `name=text` has a default.
    pub(crate) ports: &'static str,
}

const MANY: usize = usize::MAX;

macro_rules! rows {
    ($($name:literal $kind:ident $least:literal $most:tt $ports:literal;)*) => {
        &[$(NodeRow { name: $name, kind: BehaviourKind::$kind, children: ($least, rows!(@ $most)), ports: $ports }),*]
    };
    (@ many) => { MANY };
    (@ $most:literal) => { $most };
}

/// Nodes, those of BehaviorTree.CPP first, then those of Nav2. Leaves of Nav2 that are actions or services of
/// ROS have rows in `ros` too.
pub(crate) const ROWS: &[NodeRow] = rows! {
    "Sequence" Sequence 1 many "";
    "AsyncSequence" Sequence 1 many "";
    "SequenceWithMemory" SequenceWithMemory 1 many "";
    "SequenceStar" SequenceWithMemory 1 many "";
    "Fallback" Fallback 1 many "";
    "Selector" Fallback 1 many "";
    "AsyncFallback" Fallback 1 many "";
    "Parallel" Parallel 1 many "success_count=-1 failure_count=1 success_threshold failure_threshold threshold";
    "ParallelAll" ParallelAll 1 many "max_failures=1";
    "ReactiveSequence" ReactiveSequence 1 many "";
    "ReactiveFallback" ReactiveFallback 1 many "";
    "IfThenElse" IfThenElse 2 3 "";
    "WhileDoElse" WhileDoElse 2 3 "";
    "TryCatch" TryCatch 2 many "catch_on_halt=false";
    "Inverter" Inverter 1 1 "";
    "RetryUntilSuccessful" Retry 1 1 "num_attempts!";
    "RetryUntilSuccesful" Retry 1 1 "num_attempts!";
    "Repeat" Repeat 1 1 "num_cycles!";
    "Timeout" Timeout 1 1 "msec!";
    "Delay" Delay 1 1 "delay_msec!";
    "ForceSuccess" ForceSuccess 1 1 "";
    "ForceFailure" ForceFailure 1 1 "";
    "KeepRunningUntilFailure" KeepRunning 1 1 "";
    "RunOnce" RunOnce 1 1 "then_skip=true";
    "Precondition" Precondition 1 1 "if! else=FAILURE";
    "Loop" Loop 1 1 "*queue! if_empty=SUCCESS >value";
    "LoopInt" Loop 1 1 "*queue! if_empty=SUCCESS >value";
    "LoopBool" Loop 1 1 "*queue! if_empty=SUCCESS >value";
    "LoopDouble" Loop 1 1 "*queue! if_empty=SUCCESS >value";
    "LoopString" Loop 1 1 "*queue! if_empty=SUCCESS >value";
    "BlackboardCheckInt" BlackboardCheck 1 1 "value_A! value_B! return_on_mismatch!";
    "BlackboardCheckDouble" BlackboardCheck 1 1 "value_A! value_B! return_on_mismatch!";
    "BlackboardCheckString" BlackboardCheck 1 1 "value_A! value_B! return_on_mismatch!";
    "BlackboardCheckBool" BlackboardCheck 1 1 "value_A! value_B! return_on_mismatch!";
    "SkipUnlessUpdated" SkipUnlessUpdated 1 1 "entry!";
    "WaitValueUpdate" WaitValueUpdated 1 1 "entry!";
    "SubTree" SubTree 0 0 "";
    "SubTreePlus" SubTree 0 0 "";
    "AlwaysSuccess" AlwaysSuccess 0 0 "";
    "AlwaysFailure" AlwaysFailure 0 0 "";
    "Script" Script 0 0 "code!";
    "ScriptCondition" ScriptCondition 0 0 "code!";
    "SetBlackboard" SetBlackboard 0 0 "value! *output_key!";
    "UnsetBlackboard" UnsetBlackboard 0 0 "key!";
    "Sleep" Sleep 0 0 "msec!";

    "PipelineSequence" Pipeline 1 many "";
    "RecoveryNode" Recovery 2 2 "number_of_retries=1";
    "RoundRobin" RoundRobin 1 many "wrap_around=false";
    "NonblockingSequence" Nonblocking 1 many "";
    "PersistentSequence" Persistent 1 many "*current_child_idx!";
    "RateController" RateController 1 1 "hz=10.0";
    "DistanceController" DistanceController 1 1 "distance=1.0 global_frame robot_base_frame";
    "SpeedController" SpeedController 1 1
        "min_rate=0.1 max_rate=1.0 min_speed=0.0 max_speed=0.5 goal goals filter_duration";
    "GoalUpdatedController" GoalUpdatedController 1 1 "goal goals";
    "GoalUpdater" GoalUpdater 1 1 "input_goal input_goals >output_goal >output_goals goal_updater_topic \
        goals_updater_topic";
    "SingleTrigger" SingleTrigger 1 1 "";
    "PathLongerOnApproach" PathLonger 1 1 "path prox_len=3.0 length_factor=2.0";

    "ArePosesNear" Condition 0 0 "ref_pose target_pose global_frame tolerance";
    "AreErrorCodesPresent" Condition 0 0 "error_code error_codes_to_check";
    "DistanceTraveled" Condition 0 0 "distance global_frame robot_base_frame";
    "GlobalUpdatedGoal" Condition 0 0 "goal goals";
    "GoalReached" Condition 0 0 "goal global_frame robot_base_frame";
    "GoalUpdated" Condition 0 0 "goal goals";
    "InitialPoseReceived" Condition 0 0 "initial_pose_received";
    "IsBatteryCharging" Condition 0 0 "battery_topic";
    "IsBatteryLow" Condition 0 0 "min_battery battery_topic is_voltage";
    "IsGoalNearby" Condition 0 0 "path proximity_threshold max_robot_pose_search_dist global_frame robot_base_frame";
    "IsPathValid" Condition 0 0 "path server_timeout service_name max_cost consider_cost_change_obstacle";
    "IsStuck" Condition 0 0 "";
    "IsStopped" Condition 0 0 "velocity_threshold duration_stopped";
    "IsWithinPathTrackingBounds" Condition 0 0 "max_error_left max_error_right max_error_heading tracking_feedback";
    "PathExpiringTimer" Condition 0 0 "seconds path";
    "TimeExpired" Condition 0 0 "seconds";
    "TransformAvailable" Condition 0 0 "child parent";
    "WouldAControllerRecoveryHelp" Condition 0 0 "error_code error_codes_to_check";
    "WouldAPlannerRecoveryHelp" Condition 0 0 "error_code error_codes_to_check";
    "WouldARouteRecoveryHelp" Condition 0 0 "error_code error_codes_to_check";
    "WouldASmootherRecoveryHelp" Condition 0 0 "error_code error_codes_to_check";

    "AppendGoalPoseToGoals" SyncAction 0 0 "goal_pose input_goals >output_goals";
    "CheckPoseOccupancy" SyncAction 0 0 "pose service_name server_timeout use_footprint";
    "ConcatenatePaths" SyncAction 0 0 "input_path1 input_path2 >output_path";
    "ControllerSelector" SyncAction 0 0 "topic_name default_controller >selected_controller";
    "ExtractRouteNodesAsGoals" SyncAction 0 0 "route >goals";
    "GetCurrentPose" SyncAction 0 0 "global_frame robot_base_frame >current_pose";
    "GetNextFewGoals" SyncAction 0 0 "input_goals num_goals >output_goals";
    "GetPoseFromPath" SyncAction 0 0 "path index >pose";
    "GoalCheckerSelector" SyncAction 0 0 "topic_name default_goal_checker >selected_goal_checker";
    "PathHandlerSelector" SyncAction 0 0 "topic_name default_path_handler >selected_path_handler";
    "PlannerSelector" SyncAction 0 0 "topic_name default_planner >selected_planner";
    "ProgressCheckerSelector" SyncAction 0 0 "topic_name default_progress_checker >selected_progress_checker";
    "RemovePassedGoals" SyncAction 0 0
        "input_goals >output_goals radius global_frame robot_base_frame input_waypoint_statuses \
         >output_waypoint_statuses";
    "SmootherSelector" SyncAction 0 0 "topic_name default_smoother >selected_smoother";
    "TruncatePath" SyncAction 0 0 "distance input_path >output_path";
    "TruncatePathLocal" SyncAction 0 0
        "input_path >output_path distance_forward distance_backward robot_frame transform_tolerance pose \
         angular_distance_weight max_robot_pose_search_dist";
};

/// Returns the row of a name.
pub(crate) fn row(name: &str) -> Option<&'static NodeRow> {
    ROWS.iter().find(|row| row.name == name)
}

/// Returns the number of cases of `Switch2`, `Switch3` and so on.
pub(crate) fn switch_cases(name: &str) -> Option<usize> {
    name.strip_prefix("Switch")?.parse().ok().filter(|&cases| (2..100).contains(&cases))
}

/// A port, as a row or a file declares it.
#[derive(Clone, Debug)]
pub(crate) struct PortRow {
    pub(crate) name: String,
    pub(crate) direction: Direction,
    pub(crate) is_needed: bool,
    pub(crate) default: Option<String>,
}

/// Returns the ports of a row.
pub(crate) fn ports(text: &str) -> impl Iterator<Item = PortRow> {
    text.split_whitespace().map(|word| {
        let (word, default) =
            word.split_once('=').map_or((word, None), |(name, text)| (name, Some(text.to_owned())));
        let is_needed = word.ends_with('!');
        let word = word.trim_end_matches('!');
        let (direction, name) = match word.split_at(1) {
            (">", name) => (Direction::Out, name),
            ("*", name) => (Direction::Both, name),
            _ => (Direction::In, word),
        };
        PortRow { name: name.to_owned(), direction, is_needed, default }
    })
}

/// Returns whether a name is that of a condition by its first word, as `IsDoorOpen`.
pub(crate) fn is_condition_name(name: &str) -> bool {
    let words = ["Is", "Are", "Has", "Have", "Was", "Can", "Should", "Would", "is", "are", "has", "have"];
    words.iter().any(|word| {
        name.strip_prefix(word).is_some_and(|rest| rest.starts_with(|c: char| c.is_uppercase() || c == '_'))
    })
}
