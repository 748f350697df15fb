//! Helpers that the workspace-wide tests share.
