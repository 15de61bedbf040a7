//! The last two chunks of a key, without the robot: what a service offers or needs, whoever it works for.

use super::{Call, Entry, ROOT, Stream, TABLE};
use crate::codec::Message;
use crate::{Refusal, RobotId};
use std::fmt;

/// One end of a wire: a stream or a call of a service, for example `navigator/pose`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Port {
    /// The service of the key.
    pub service: &'static str,
    /// Its stream or call.
    pub name: &'static str,
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.service, self.name)
    }
}

impl Port {
    /// Reads `navigator/pose`: a stream of the table that stands there by its own name.
    ///
    /// # Errors
    /// [`Refusal::Unknown`] with all names.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        let known = TABLE.iter().filter(|entry| !entry.service.starts_with('<'));
        let ports: Vec<Self> = known.map(|entry| Self { service: entry.service, name: entry.name }).collect();
        ports.iter().copied().find(|port| port.to_string() == text).ok_or_else(|| Refusal::Unknown {
            what: "stream".into(),
            got: text.chars().take(64).collect(),
            known: ports.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
        })
    }
    /// The key of one robot, or of every robot: for access rules and for looking at what was heard.
    #[must_use]
    pub fn key(self, robot: Option<&RobotId>) -> String {
        format!("{ROOT}/{}/{self}", robot.map_or("*", RobotId::as_str))
    }
    /// Its line of the table.
    #[must_use]
    pub fn entry(self) -> Option<&'static Entry> {
        super::find_port(self.service, self.name)
    }
}

impl<M: Message> Stream<M> {
    /// The stream without a robot.
    #[must_use]
    pub const fn port(&self) -> Port {
        Port { service: self.service, name: self.name }
    }
}
impl<Q: Message, A: Message> Call<Q, A> {
    /// The call without a robot.
    #[must_use]
    pub const fn port(&self) -> Port {
        Port { service: self.service, name: self.name }
    }
}
