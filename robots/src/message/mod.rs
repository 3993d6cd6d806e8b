//! Messages of ROS 2 whose types are known at run time only.
