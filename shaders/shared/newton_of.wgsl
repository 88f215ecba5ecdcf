//! Where the nonlinear solve of a member stands, the same for all lanes of a workgroup.

var<storage, read_write> newton: array<Newton>;

var<workgroup> common_newton: Newton;

// A member's state, read once for a workgroup.
fn newton_of(local: u32, member: u32) -> Newton {
    if local == 0u {
        common_newton = newton[member];
    }
    return workgroupUniformLoad(&common_newton);
}
