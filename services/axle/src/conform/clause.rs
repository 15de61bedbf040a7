//! What a clause of the contract is, and what can come of it.

use super::client::Client;
use axle_schema::Refusal;
use std::future::Future;
use std::pin::Pin;

/// What came of a clause.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Finding {
    /// The drive does as the contract says.
    Pass(String),
    /// It does not, and the contract says that it must.
    Fail(String),
    /// It does not, and the contract leaves it open.
    Optional(String),
    /// It does not offer the operation, and the contract leaves that open.
    NotOffered(String),
}

impl Finding {
    pub(super) const fn verdict(&self) -> &'static str {
        match self {
            Self::Pass(_) => "pass",
            Self::Fail(_) => "fail",
            Self::Optional(_) => "optional",
            Self::NotOffered(_) => "not offered",
        }
    }
    pub(super) fn detail(&self) -> &str {
        match self {
            Self::Pass(detail) | Self::Fail(detail) | Self::Optional(detail) | Self::NotOffered(detail) => {
                detail
            }
        }
    }
}

/// What looks whether a clause holds: a refusal of the drive is a finding as well.
pub(super) type Probe = for<'a> fn(&'a mut Client) -> Probing<'a>;
/// A probe at work.
pub(super) type Probing<'a> = Pin<Box<dyn Future<Output = Result<Finding, Refusal>> + Send + 'a>>;

/// One clause.
pub(super) struct Clause {
    /// A short name that does not change.
    pub(super) name: &'static str,
    /// What the contract says.
    pub(super) text: &'static str,
    /// Whether a drive need not offer the operation.
    pub(super) is_optional: bool,
    /// Looks whether it holds.
    pub(super) probe: Probe,
}

impl Clause {
    /// A clause that every drive keeps.
    pub(super) const fn must(name: &'static str, text: &'static str, probe: Probe) -> Self {
        Self { name, text, is_optional: false, probe }
    }
    /// A clause about what a drive need not offer.
    pub(super) const fn may(name: &'static str, text: &'static str, probe: Probe) -> Self {
        Self { name, text, is_optional: true, probe }
    }

    /// Brings the drive to rest and looks.
    pub(super) async fn judge(&self, client: &mut Client) -> Finding {
        if let Err(refusal) = client.settle().await {
            return Finding::Fail(format!("the drive could not be brought to rest and enabled: {refusal}"));
        }
        match (self.probe)(client).await {
            Ok(finding) => finding,
            Err(refusal @ (Refusal::Unavailable { .. } | Refusal::Unknown { .. })) if self.is_optional => {
                Finding::NotOffered(refusal.to_string())
            }
            Err(refusal) => Finding::Fail(refusal.to_string()),
        }
    }
}

/// Passes if it is so, and fails with these words otherwise.
pub(super) fn expect(is_so: bool, pass: impl Into<String>, fail: impl FnOnce() -> String) -> Finding {
    if is_so { Finding::Pass(pass.into()) } else { Finding::Fail(fail()) }
}
