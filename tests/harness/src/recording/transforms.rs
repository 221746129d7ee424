//! `/tf_static`: the mount, found by climbing from the sensor's frame to the road's.

use std::collections::BTreeMap;

use super::ros::{Quaternion, TfMessage, Transform, Vector3};
use crate::geometry::pose::SensorPose;

/// Static transforms by child frame.
#[derive(Debug, Clone, Default)]
pub struct Transforms(BTreeMap<String, (String, Transform)>);

impl Transforms {
    pub fn add(&mut self, message: TfMessage) {
        for t in message.transforms {
            let name = |s: String| s.trim_start_matches('/').to_owned();
            self.0.insert(name(t.child_frame_id), (name(t.header.frame_id), t.transform));
        }
    }

    /// `parent -> child` pairs, for error messages.
    pub fn describe(&self) -> String {
        if self.0.is_empty() {
            return "none".into();
        }
        self.0.iter().map(|(child, (parent, _))| format!("{parent} -> {child}")).collect::<Vec<_>>().join(", ")
    }

    /// Why no transform joins `frame` to `root`, and what to do; `moving` are those of `/tf`.
    pub fn why_not(&self, moving: &Self, root: &str, frame: &str) -> String {
        let found = format!(
            "/tf_static joins no frame `{root}` to the radar's `{frame}` (transforms found: {})",
            self.describe()
        );
        let give = "give the mount with --mount x,y,z,yaw,pitch,roll (metres, degrees)";
        if let Some((child, (parent, t))) = self.0.iter().find(|(_, (_, t))| !is_rotation(&t.rotation)) {
            let Quaternion { x, y, z, w } = t.rotation;
            return format!(
                "the rotation of the transform {parent} -> {child} is none: its quaternion is {x}, {y}, {z}, {w}, whose length is not 1 (no rotation is 0, 0, 0, 1); mend the one who sends it, or {give}"
            );
        }
        let mut all = moving.clone();
        all.0.extend(self.0.clone());
        if let Some(pose) = all.pose(root, frame) {
            let [x, y, z] = pose.position;
            let [yaw, pitch, roll] = [pose.yaw_rad(), pose.pitch_rad(), pose.roll_rad()].map(f64::to_degrees);
            return format!(
                "{found}; the transform is there on /tf, which is for what moves: send it on /tf_static, or, if it does not move, --mount={x:.3},{y:.3},{z:.3},{yaw:.2},{pitch:.2},{roll:.2}"
            );
        }
        if self.0.is_empty() {
            return format!(
                "there is no /tf_static; of a split bag only the first part has it (its name ends in _0.mcap): read that one, or {give}"
            );
        }
        format!("{found}. Name the frames with --road-frame and --radar-frame, or {give}.")
    }

    /// Pose of `frame` in `root`, if a chain of transforms joins them.
    pub fn pose(&self, root: &str, frame: &str) -> Option<SensorPose> {
        let mut frame = frame.trim_start_matches('/');
        let mut total =
            Transform { translation: Vector3::default(), rotation: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 } };
        // a chain longer than the number of transforms is a loop
        for _ in 0..=self.0.len() {
            if frame == root {
                let Transform { translation: t, rotation: q } = total;
                return Some(SensorPose::from_quaternion([t.x, t.y, t.z], [q.x, q.y, q.z, q.w]));
            }
            let (parent, step) = self.0.get(frame)?;
            total = chain(step, &total)?;
            frame = parent;
        }
        None
    }
}

fn length(q: &Quaternion) -> f64 {
    (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w).sqrt()
}

/// Whether a quaternion is one of a rotation, but for rounding.
fn is_rotation(q: &Quaternion) -> bool {
    (0.5..2.0).contains(&length(q))
}

/// First `inner`, then `outer`; `None` where the rotation is no rotation.
fn chain(outer: &Transform, inner: &Transform) -> Option<Transform> {
    let q = &outer.rotation;
    if !is_rotation(q) {
        return None;
    }
    let norm = length(q);
    let q = Quaternion { x: q.x / norm, y: q.y / norm, z: q.z / norm, w: q.w / norm };
    let pose = SensorPose::from_quaternion(
        [outer.translation.x, outer.translation.y, outer.translation.z],
        [q.x, q.y, q.z, q.w],
    );
    let v = pose.rotate_to_road([inner.translation.x, inner.translation.y, inner.translation.z]);
    let p = &inner.rotation;
    Some(Transform {
        translation: Vector3 { x: pose.position[0] + v[0], y: pose.position[1] + v[1], z: pose.position[2] + v[2] },
        rotation: Quaternion {
            w: q.w * p.w - q.x * p.x - q.y * p.y - q.z * p.z,
            x: q.w * p.x + q.x * p.w + q.y * p.z - q.z * p.y,
            y: q.w * p.y - q.x * p.z + q.y * p.w + q.z * p.x,
            z: q.w * p.z + q.x * p.y - q.y * p.x + q.z * p.w,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::super::ros::{Header, TransformStamped};
    use super::*;

    fn step(parent: &str, child: &str, t: [f64; 3], yaw: f64) -> TransformStamped {
        TransformStamped {
            header: Header { frame_id: parent.into(), ..Default::default() },
            child_frame_id: child.into(),
            transform: Transform {
                translation: Vector3 { x: t[0], y: t[1], z: t[2] },
                rotation: Quaternion::from_yaw(yaw),
            },
        }
    }

    #[test]
    fn a_chain_is_climbed_in_order() {
        let mut tf = Transforms::default();
        tf.add(TfMessage {
            transforms: vec![
                step("mast", "radar", [1.0, 0.0, 0.5], 0.0),
                step("road", "mast", [10.0, 5.0, 5.0], std::f64::consts::FRAC_PI_2),
            ],
        });
        let pose = tf.pose("road", "/radar").unwrap();
        // the arm points along the mast's x, which is the road's y
        assert!((pose.position[0] - 10.0).abs() < 1e-12);
        assert!((pose.position[1] - 6.0).abs() < 1e-12);
        assert!((pose.position[2] - 5.5).abs() < 1e-12);
        assert!((pose.yaw_rad() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!(tf.pose("map", "radar").is_none());
    }

    #[test]
    fn a_mount_that_cannot_be_used_is_told_with_what_is_there() {
        let with = |steps: Vec<TransformStamped>| {
            let mut tf = Transforms::default();
            tf.add(TfMessage { transforms: steps });
            tf
        };
        let none = Transforms::default();
        let on_tf = with(vec![step("road", "radar", [1.0, 2.0, 5.0], 0.1)]);
        let said = none.why_not(&on_tf, "road", "radar");
        assert!(said.contains("on /tf,") && said.contains("--mount=1.000,2.000,5.000,5.73,"), "{said}");
        assert!(none.why_not(&none, "road", "radar").contains("split bag only the first part has it"));
        let mut zero = step("road", "radar", [0.0; 3], 0.0);
        zero.transform.rotation.w = 0.0;
        assert!(with(vec![zero]).why_not(&none, "road", "radar").contains("road -> radar is none: its quaternion"));
        let other = with(vec![step("map", "base", [0.0; 3], 0.0)]).why_not(&none, "road", "radar");
        assert!(other.contains("transforms found: map -> base") && other.contains("--road-frame"), "{other}");
    }

    #[test]
    fn a_loop_of_frames_ends() {
        let mut tf = Transforms::default();
        tf.add(TfMessage { transforms: vec![step("a", "b", [0.0; 3], 0.0), step("b", "a", [0.0; 3], 0.0)] });
        assert!(tf.pose("road", "a").is_none());
    }
}
