//! What a puppet plays by itself.

/// What a puppet does after its clips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum After {
    /// It holds the last pose.
    Hold,
    /// It goes home.
    #[default]
    Home,
}

/// What a puppet plays by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Show<'s> {
    /// Clips to play from power on, in order.
    pub playlist: &'s [u16],
    /// Whether the playlist begins again.
    pub repeats: bool,
    /// Clip to repeat while nothing else plays.
    pub idle_clip: Option<u16>,
    /// Clip that the trigger starts.
    pub trigger_clip: Option<u16>,
    /// What comes after the clips.
    pub after: After,
}
