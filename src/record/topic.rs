//! The channels of a recording.

/// One channel. Its number is its channel id in the file: part of the format, so that a recording whose first
/// chunk is lost can still be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topic {
    Imu = 1,
    Traffic = 2,
    TickInput = 3,
    TickOutput = 4,
    Event = 5,
    Summary = 6,
    Header = 7,
}

impl Topic {
    pub(super) const ALL: [Topic; 7] = [
        Topic::Imu,
        Topic::Traffic,
        Topic::TickInput,
        Topic::TickOutput,
        Topic::Event,
        Topic::Summary,
        Topic::Header,
    ];

    /// Channel id in the file.
    pub(super) fn id(self) -> u16 {
        self as u16
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Topic::Imu => "/imu",
            Topic::Traffic => "/otolith/traffic",
            Topic::TickInput => "/otolith/tick_input",
            Topic::TickOutput => "/otolith/tick_output",
            Topic::Event => "/otolith/event",
            Topic::Summary => "/otolith/summary",
            Topic::Header => "/otolith/header",
        }
    }

    pub(super) fn from_name(name: &str) -> Option<Topic> {
        Topic::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// Name and text of the ROS 2 message definition.
    pub(super) fn schema(self) -> (&'static str, &'static str) {
        match self {
            Topic::Imu => ("sensor_msgs/msg/Imu", include_str!("msg/Imu.msg")),
            Topic::Traffic => ("otolith_msgs/msg/Traffic", include_str!("msg/Traffic.msg")),
            Topic::TickInput => ("otolith_msgs/msg/TickInput", include_str!("msg/TickInput.msg")),
            Topic::TickOutput => ("otolith_msgs/msg/TickOutput", include_str!("msg/TickOutput.msg")),
            Topic::Event | Topic::Summary | Topic::Header => {
                ("std_msgs/msg/String", include_str!("msg/String.msg"))
            }
        }
    }
}
