//! Leaves of Nav2 that are actions and services of ROS, one row for each.

/// A leaf that calls an action or a service.
pub(crate) struct RosRow {
    pub(crate) leaf: &'static str,
    pub(crate) is_action: bool,
    /// Name of the server, unless the port `server_name` or `service_name` has another.
    pub(crate) server: &'static str,
    /// Type, in the package `nav2_msgs`.
    pub(crate) interface: &'static str,
    /// Fields of the goal or request by the ports that they come from: `field=port`; `x:field=port` puts a
    /// number into the field `x` of a point, `-x:` its opposite.
    pub(crate) inputs: &'static str,
    /// Ports that are set, and fields of the result: `port=field`.
    pub(crate) outputs: &'static str,
}

macro_rules! rows {
    ($($leaf:literal $way:ident $server:literal $interface:literal $inputs:literal $outputs:literal;)*) => {
        &[$(RosRow {
            leaf: $leaf,
            is_action: rows!(@ $way),
            server: $server,
            interface: $interface,
            inputs: $inputs,
            outputs: $outputs,
        }),*]
    };
    (@ action) => { true };
    (@ service) => { false };
}

/// The leaves.
pub(crate) const ROWS: &[RosRow] = rows! {
    "AssistedTeleop" action "assisted_teleop" "AssistedTeleop" "time_allowance=time_allowance" "";
    "BackUp" action "backup" "BackUp"
        "-x:target=backup_dist speed=backup_speed time_allowance=time_allowance" "";
    "ComputePathThroughPoses" action "compute_path_through_poses" "ComputePathThroughPoses"
        "goals=goals start=start planner_id=planner_id" "path=path";
    "ComputePathToPose" action "compute_path_to_pose" "ComputePathToPose"
        "goal=goal start=start planner_id=planner_id" "path=path";
    "ComputeRoute" action "compute_route" "ComputeRoute"
        "start_id=start_id goal_id=goal_id start=start goal=goal use_start=use_start use_poses=use_poses"
        "route=route path=path planning_time=planning_time";
    "DockRobot" action "dock_robot" "DockRobot"
        "use_dock_id=use_dock_id dock_id=dock_id dock_pose=dock_pose dock_type=dock_type \
         max_staging_time=max_staging_time navigate_to_staging_pose=navigate_to_staging_pose"
        "success=success num_retries=num_retries";
    "DriveOnHeading" action "drive_on_heading" "DriveOnHeading"
        "x:target=dist_to_travel speed=speed time_allowance=time_allowance" "";
    "FollowPath" action "follow_path" "FollowPath"
        "path=path controller_id=controller_id goal_checker_id=goal_checker_id \
         progress_checker_id=progress_checker_id" "";
    "NavigateThroughPoses" action "navigate_through_poses" "NavigateThroughPoses"
        "poses=goals behavior_tree=behavior_tree" "";
    "NavigateToPose" action "navigate_to_pose" "NavigateToPose" "pose=goal behavior_tree=behavior_tree" "";
    "SmoothPath" action "smooth_path" "SmoothPath"
        "path=unsmoothed_path smoother_id=smoother_id max_smoothing_duration=max_smoothing_duration \
         check_for_collisions=check_for_collisions"
        "smoothed_path=path smoothing_duration=smoothing_duration was_completed=was_completed";
    "Spin" action "spin" "Spin" "target_yaw=spin_dist time_allowance=time_allowance" "";
    "UndockRobot" action "undock_robot" "UndockRobot"
        "dock_type=dock_type max_undocking_time=max_undocking_time" "success=success";
    "Wait" action "wait" "Wait" "time=wait_duration" "";
    "ClearCostmapAroundPose" service "clear_around_pose" "ClearCostmapAroundPose"
        "pose=pose reset_distance=reset_distance" "";
    "ClearCostmapAroundRobot" service "clear_around_robot" "ClearCostmapAroundRobot"
        "reset_distance=reset_distance" "";
    "ClearCostmapExceptRegion" service "clear_except_region" "ClearCostmapExceptRegion"
        "reset_distance=reset_distance" "";
    "ClearEntireCostmap" service "clear_entirely" "ClearEntireCostmap" "" "";
};

/// Returns the row of a leaf.
pub(crate) fn row(leaf: &str) -> Option<&'static RosRow> {
    ROWS.iter().find(|row| row.leaf == leaf)
}

/// Returns the pairs in a text of a row.
pub(crate) fn pairs(text: &'static str) -> impl Iterator<Item = (&'static str, &'static str)> {
    text.split_whitespace().filter_map(|word| word.split_once('='))
}
