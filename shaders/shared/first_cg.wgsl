//! Before the first iteration of conjugate gradients by many workgroups: no iteration came before, and one part holds the whole
//! of rᵀ M⁻¹ r.

fn first_cg(local: u32, member: u32, rz: f32) {
    if local < 4u {
        cg_sums[scalars_at(member) + local] = vec4(0.0);
    }
    let start = parts_at(member, 1u);
    for (var i = local; i < groups_of_nodes(WIDE); i += 256u) {
        cg_sums[start + i] = vec4(select(0.0, rz, i == 0u), 0.0, 0.0, 0.0);
    }
}
