//! z = M⁻¹ r by one workgroup of 256.
// use shared/coarse_alone
// use shared/correction
// use shared/held

// Puts z in its part, from the residual and what restrict_alone left, and returns the sums of the residual (`shared/iteration`).
fn precondition_alone(local: u32, system: u32, home: u32) -> vec3<f32> {
    let choice = coarse_choice(home);
    let wrenches = wrenches_at(system, 1u);
    for (var first = 0u; first < shape.groups; first += 64u) {
        let own = first + local / 4u;
        var sum: Motion;
        if own < shape.groups {
            for (var g = local % 4u; g < shape.groups; g += 4u) {
                let w = Wrench(cg_sums[wrenches + 2u * g].xyz, cg_sums[wrenches + 2u * g + 1u].xyz);
                sum = add_motion(sum, u32(choice.x), g, own, w);
            }
        }
        sum = total_of_four(local, sum.upper, sum.lower);
        if own < shape.groups && local % 4u == 0u {
            let motion = motion_of(sum, choice.y);
            cg_sums[motions_at(system) + 2u * own] = vec4(motion.force, 0.0);
            cg_sums[motions_at(system) + 2u * own + 1u] = vec4(motion.torque, 0.0);
        }
    }
    storageBarrier();
    workgroupBarrier();
    var left = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(system, i);
        let arm = arms[i];
        let g = group_of(arm);
        let motion = Wrench(cg_sums[motions_at(system) + 2u * g].xyz, cg_sums[motions_at(system) + 2u * g + 1u].xyz);
        let r = solving[solving_part(REST) + a].xyz;
        let first = scaled(at_node(home, i), r);
        let z = first + carried(turn_of_group(home, g), arm, motion);
        solving[solving_part(SCALED) + a] = vec4(z, 0.0);
        left += vec4(dot(r, z), dot(r, first), 0.0, 0.0);
        if shape.held != 0u && is_held(home, i) {
            left.z += dot(r, first);
        }
    }
    return total(local, left).xyz;
}
