//! What a unit has run over before the recording that is judged.

use std::fmt;
use std::sync::Arc;

use crate::recording::{Frame, Recording};

/// Frames of other recordings of a radar, oldest first; none where nothing was learnt from any.
#[derive(Clone, Default)]
pub struct Before(Option<Arc<[Frame]>>);

impl Before {
    /// These recordings, if there are any.
    pub fn of(recordings: impl IntoIterator<Item = Recording>) -> Self {
        let mut recordings = recordings.into_iter().peekable();
        let any = recordings.peek().is_some();
        Self(any.then(|| recordings.flat_map(|recording| recording.frames).collect()))
    }

    pub fn frames(&self) -> Option<&[Frame]> {
        self.0.as_deref()
    }
}

impl fmt::Debug for Before {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} frames", self.0.as_ref().map_or(0, |frames| frames.len()))
    }
}

impl PartialEq for Before {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }
}
