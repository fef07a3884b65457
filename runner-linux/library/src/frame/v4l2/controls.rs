//! Exposure, gain and focus, where a camera has them. Automatic ones hunt when the camera passes from sky to wall.

use std::fmt::Write as _;

use v4l::Device;
use v4l::control::{Control, Value};

/// `V4L2_CID_EXPOSURE_AUTO`: 1 is manual, 3 is by aperture priority, what webcams call automatic.
const EXPOSURE_AUTO: u32 = 0x009A_0901;
const EXPOSURE_MANUAL: i64 = 1;
/// `V4L2_CID_EXPOSURE_ABSOLUTE`, in 100 µs.
const EXPOSURE: u32 = 0x009A_0902;
/// `V4L2_CID_AUTOGAIN`.
const AUTOGAIN: u32 = 0x0098_0912;
/// `V4L2_CID_GAIN`.
const GAIN: u32 = 0x0098_0913;
/// `V4L2_CID_FOCUS_AUTO`.
const FOCUS_AUTO: u32 = 0x009A_090C;
/// `V4L2_CID_FOCUS_ABSOLUTE`.
const FOCUS: u32 = 0x009A_090A;

/// What to lock. What is not named stays as the device has it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Controls {
    /// Exposure in milliseconds.
    pub exposure_ms: Option<f64>,
    /// Gain in the device's own units.
    pub gain: Option<i64>,
    /// Focus in the device's own units.
    pub focus: Option<i64>,
}

impl Controls {
    /// Sets them, warns of those that the device does not take, and says in a few words which it took.
    pub(super) fn set(&self, device: &Device, camera: &str) -> String {
        let exposure = self.exposure_ms.map(|ms| (ms * 10.0).clamp(1.0, 1e9) as i64);
        let locks = [
            ("exposure", EXPOSURE_AUTO, Value::Integer(EXPOSURE_MANUAL), EXPOSURE, exposure),
            ("gain", AUTOGAIN, Value::Boolean(false), GAIN, self.gain),
            ("focus", FOCUS_AUTO, Value::Boolean(false), FOCUS, self.focus),
        ];
        let mut said = String::new();
        for (name, automatic, off, id, value) in locks {
            let Some(value) = value else { continue };
            // Not every device has an automatic to switch off.
            let _ = device.set_control(Control { id: automatic, value: off });
            match device.set_control(Control { id, value: Value::Integer(value) }) {
                Ok(()) => {
                    // Writing to a string cannot fail.
                    let _ = write!(said, ", {name} {value}");
                }
                Err(error) => {
                    tracing::warn!(camera, control = name, value, %error, "the camera does not take this setting");
                }
            }
        }
        said
    }
}
