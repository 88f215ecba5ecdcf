//! A pinhole camera and its one-line description on the command line.

use glam::{DAffine3, DMat3, DVec3};
use std::str::FromStr;

/// A pinhole camera without lens distortion; axes as in OpenCV (x right, y down, z forward), pixel (0, 0) is the centre of
/// the top-left pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Pinhole {
    /// Label in the recording.
    pub name: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length along x [pixels].
    pub fx: f64,
    /// Focal length along y [pixels].
    pub fy: f64,
    /// Column of the principal point [pixels].
    pub cx: f64,
    /// Row of the principal point [pixels].
    pub cy: f64,
    /// Rigid placement in the world.
    pub world_from_camera: DAffine3,
}

/// What is wrong with a camera description.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct CameraError(pub String);

impl Pinhole {
    /// A camera at `eye` that looks at `target`, `up` pointing to the top of the picture, with a vertical field of view `fov`
    /// [degrees].
    ///
    /// # Errors
    /// When the viewing direction is zero or parallel to `up`, or the field of view is not between 0 and 180 degrees.
    pub fn looking_at(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov: f64,
        width: usize,
        height: usize,
    ) -> Result<Pinhole, CameraError> {
        if !(fov > 0.0 && fov < 180.0) {
            return Err(CameraError(format!("fov = {fov} is not an angle between 0 and 180 degrees")));
        }
        if width == 0 || height == 0 || width > 16384 || height > 16384 {
            return Err(CameraError(format!("size = {width}x{height} is not between 1x1 and 16384x16384")));
        }
        let z = (target - eye).try_normalize().ok_or_else(|| CameraError("eye and target are the same point".into()))?;
        let x = z.cross(up).try_normalize().filter(|x| x.is_finite() && z.cross(up.normalize()).length() > 1e-6);
        let x = x.ok_or_else(|| CameraError("up is zero or parallel to the viewing direction; give another up=x,y,z".into()))?;
        let y = z.cross(x);
        let f = 0.5 * height as f64 / (0.5 * fov.to_radians()).tan();
        Ok(Pinhole {
            name: "cam0".into(),
            width,
            height,
            fx: f,
            fy: f,
            cx: 0.5 * (width as f64 - 1.0),
            cy: 0.5 * (height as f64 - 1.0),
            world_from_camera: DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), eye),
        })
    }

    /// A camera that sees the whole box `min..max` [m] from the side, `up` upwards in the picture: the default view.
    pub fn framing(min: DVec3, max: DVec3, up: DVec3, width: usize, height: usize) -> Pinhole {
        let up = up.try_normalize().unwrap_or(DVec3::Z);
        // A three-quarter view: two horizontal directions made from `up`, and a little from above.
        let a = up.any_orthonormal_vector();
        Pinhole::facing(min, max, (a * 0.5 - up.cross(a) * 0.85 + up * 0.35).normalize(), up, width, height)
    }

    /// The same from a direction: that from the middle of the box to the camera, which is not parallel to `up`.
    pub fn facing(min: DVec3, max: DVec3, direction: DVec3, up: DVec3, width: usize, height: usize) -> Pinhole {
        let center = 0.5 * (min + max);
        let radius = (0.5 * (max - min).length()).max(1e-9);
        let fov = 30.0_f64;
        // The sphere around the box touches the narrower half angle; 5 % stays free.
        let narrow = (0.5 * fov.to_radians()).tan() * (width as f64 / height as f64).min(1.0);
        let distance = 1.05 * radius / narrow.atan().sin();
        let (width, height) = (width.max(1), height.max(1));
        let look = |up: DVec3| Pinhole::looking_at(center + direction * distance, center, up, fov, width, height);
        // Who looks along `up` sees any other direction upwards as well.
        look(up)
            .or_else(|_| look(direction.any_orthonormal_vector()))
            .or_else(|_| Pinhole::looking_at(center + DVec3::X * distance, center, DVec3::Z, fov, width, height))
            .expect("a camera beside the box that looks at its middle has a direction")
    }

    /// Column, row and depth along the camera's z axis [m] of a world point.
    pub fn project(&self, p: DVec3) -> DVec3 {
        let q = self.world_from_camera.inverse().transform_point3(p);
        DVec3::new(self.cx + self.fx * q.x / q.z, self.cy + self.fy * q.y / q.z, q.z)
    }

    /// World point of pixel (`u`, `v`) with depth `z` [m].
    pub fn unproject(&self, u: f64, v: f64, z: f64) -> DVec3 {
        self.world_from_camera.transform_point3(DVec3::new((u - self.cx) * z / self.fx, (v - self.cy) * z / self.fy, z))
    }
}

fn numbers<const N: usize>(key: &str, text: &str, form: &str) -> Result<[f64; N], CameraError> {
    let bad = || CameraError(format!("{key}={text}: expected {form}"));
    let v: Vec<f64> = text.split(',').map(|s| s.trim().parse::<f64>()).collect::<Result<_, _>>().map_err(|_| bad())?;
    let v: [f64; N] = v.try_into().map_err(|_| bad())?;
    if v.iter().all(|x| x.is_finite()) { Ok(v) } else { Err(bad()) }
}

impl FromStr for Pinhole {
    type Err = CameraError;

    /// Reads `eye=x,y,z target=x,y,z [up=x,y,z] [fov=degrees] [size=WxH] [name=label]`.
    fn from_str(text: &str) -> Result<Pinhole, CameraError> {
        let (mut eye, mut target, mut up, mut fov, mut size) = (None, None, DVec3::Z, 45.0, (640, 480));
        let mut name = None;
        for word in text.split_whitespace() {
            let (key, value) =
                word.split_once('=').ok_or_else(|| CameraError(format!("\"{word}\" is not of the form key=value")))?;
            let vector = || numbers::<3>(key, value, "three numbers x,y,z").map(DVec3::from_array);
            match key {
                "eye" => eye = Some(vector()?),
                "target" => target = Some(vector()?),
                "up" => up = vector()?,
                "fov" => fov = numbers::<1>(key, value, "one angle in degrees")?[0],
                "size" => {
                    let parsed = value.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                    size = parsed.ok_or_else(|| CameraError(format!("size={value}: expected WIDTHxHEIGHT, like 640x480")))?;
                }
                "name" => {
                    let plain = !value.is_empty() && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
                    if !plain {
                        return Err(CameraError(format!(
                            "name={value}: only letters, digits, - and _ are allowed (it names a folder)"
                        )));
                    }
                    name = Some(value.to_string());
                }
                _ => return Err(CameraError(format!("unknown key \"{key}\"; allowed are eye, target, up, fov, size, name"))),
            }
        }
        let eye = eye.ok_or_else(|| CameraError("eye=x,y,z is missing".into()))?;
        let target = target.ok_or_else(|| CameraError("target=x,y,z is missing".into()))?;
        let mut camera = Pinhole::looking_at(eye, target, up, fov, size.0, size.1)?;
        if let Some(name) = name {
            camera.name = name;
        }
        Ok(camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_is_the_middle_of_the_picture_and_up_is_up() {
        let c: Pinhole = "eye=1,-2,0.5 target=0.1,0.2,0.3 fov=40 size=64x48".parse().unwrap();
        let p = c.project(DVec3::new(0.1, 0.2, 0.3));
        assert!((p.x - 31.5).abs() < 1e-12 && (p.y - 23.5).abs() < 1e-12, "{p}");
        assert!(c.project(DVec3::new(0.1, 0.2, 0.35)).y < p.y, "a higher point has a smaller row");
        let back = c.unproject(p.x + 3.0, p.y - 2.0, p.z);
        let again = c.project(back);
        assert!((again - DVec3::new(p.x + 3.0, p.y - 2.0, p.z)).length() < 1e-12);
        assert!((c.world_from_camera.matrix3.determinant() - 1.0).abs() < 1e-12, "right-handed");
    }

    #[test]
    fn bad_descriptions_name_the_key() {
        for (text, word) in [
            ("target=0,0,0", "eye"),
            ("eye=0,0,1 target=0,0", "target"),
            ("eye=0,0,1 target=0,0,0", "up"),
            ("eye=1,0,1 target=0,0,0 fov=180", "fov"),
            ("eye=1,0,1 target=0,0,0 size=640", "size"),
            ("eye=1,0,1 target=0,0,0 fow=20", "fow"),
            ("eye=1,0,1 target=0,0,0 name=../x", "name"),
            ("eye=1,0,nan target=0,0,0", "eye"),
        ] {
            let e = text.parse::<Pinhole>().unwrap_err().to_string();
            assert!(e.contains(word), "{text}: {e}");
        }
    }
}
