//! What a puppet is held against: the clips that it plays, what its joints can do, the time on its buses, and where its
//! joints were measured to be; and a first puppet for a recording. The file itself is read by `puppet_file`.

pub mod budget;
pub mod calibrate;
pub mod channels;
pub mod joint_errors;
pub mod joint_names;
pub mod new;
pub mod rehearse;
