//! Rigid 4 × 4 matrices from files, checked.

use glam::{DAffine3, DMat3, DQuat, DVec3};

/// Files carry rotations with six digits or so; more than this is not a rotation with rounding errors.
const TOLERANCE: f64 = 1e-4;

/// The rigid motion of a row-major 4 × 4 matrix, its rotation made exactly orthonormal; or what is wrong with it.
pub(crate) fn rigid(m: [[f64; 4]; 4]) -> Result<DAffine3, String> {
    let last = DVec3::new(m[3][0], m[3][1], m[3][2]);
    if last != DVec3::ZERO || m[3][3] != 1.0 {
        let column = m[0][3] == 0.0 && m[1][3] == 0.0 && m[2][3] == 0.0;
        let hint = if column { "; the matrix looks transposed, rows are wanted" } else { "" };
        return Err(format!("not rigid: the last row is {:?}, it must be [0, 0, 0, 1]{hint}", m[3]));
    }
    let r = DMat3::from_cols_array_2d(&[[m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]]);
    let g = r.transpose() * r - DMat3::IDENTITY;
    let off = g.to_cols_array().iter().fold(0.0f64, |a, x| a.max(x.abs()));
    if off > TOLERANCE {
        let scale = r.determinant().abs().cbrt();
        let uniform = (r.transpose() * r * (1.0 / (scale * scale)) - DMat3::IDENTITY).to_cols_array();
        let hint = if uniform.iter().all(|x| x.abs() < TOLERANCE) { format!("; it scales by {scale:.6}") } else { String::new() };
        return Err(format!("not rigid: RᵀR differs from the identity by {off:.2e}, allowed {TOLERANCE:.0e}{hint}"));
    }
    if r.determinant() < 0.0 {
        return Err("not rigid: it mirrors (determinant −1); world axes are right-handed".to_string());
    }
    let q = DQuat::from_mat3(&r).normalize();
    Ok(DAffine3::from_rotation_translation(q, DVec3::new(m[0][3], m[1][3], m[2][3])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(a: &DAffine3) -> [[f64; 4]; 4] {
        let m = a.matrix3;
        let row = |i: usize| [m.col(0)[i], m.col(1)[i], m.col(2)[i], a.translation[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    #[test]
    fn rows_come_back_and_faults_are_told_apart() {
        let a = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.7), DVec3::new(1.0, 2.0, 3.0));
        let b = rigid(rows(&a)).unwrap();
        let p = DVec3::new(0.3, -0.2, 0.9);
        // Rounding of a quaternion round trip.
        assert!((a.transform_point3(p) - b.transform_point3(p)).length() < 1e-14);

        let mut m = rows(&a);
        m.iter_mut().take(3).for_each(|r| r.iter_mut().take(3).for_each(|x| *x *= 1.01));
        let e = rigid(m).unwrap_err();
        assert!(e.contains("scales by 1.01") && e.contains("2.01e-2"), "{e}");
        let mut m = rows(&a);
        m.iter_mut().take(3).for_each(|r| r[0] = -r[0]);
        assert!(rigid(m).unwrap_err().contains("mirrors"));
        let m = rows(&a);
        let t = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j: usize| m[j][i]));
        assert!(rigid(t).unwrap_err().contains("transposed"));
    }
}
