//! Puts the new state where the next trial is: free flight plus the increment, moved along the direction. The displacement is
//! kept as a multiple of the quantum and a rest, so that a long fall costs the cells no accuracy.
// use shared/mix

var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> next: array<vec4<f32>>;
var<storage, read> increment: array<vec4<f32>>;
// The solution of a solve comes first.
var<storage, read> solving: array<vec4<f32>>;
var<storage, read_write> trial: array<vec4<f32>>;
var<storage, read> newton: array<Newton>;

@compute @workgroup_size(64)
fn place_next(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    let n = newton[p.member];
    var w = increment[a].xyz + n.length * solving[a].xyz;
    var whole = vec3(0.0);
    var rest = w;
    if call.mode != 0u {
        let v = now[part(2u) + a].xyz;
        let fall = shape.theta * shape.dt * shape.dt * members[p.member].gravity.xyz;
        // A guess where the material does not exist is taken back half the way, and again.
        if n.length == 0.0 && n.trial > 0u {
            w = (exp2(-f32(n.trial)) - 1.0) * (shape.dt * v + fall);
        }
        whole = now[a].xyz;
        rest = now[part(1u) + a].xyz + (shape.dt * v + (fall + w));
    }
    trial[a] = vec4(w, 0.0);
    let steps = round(rest / shape.quantum);
    next[a] = vec4(whole + steps * shape.quantum, 0.0);
    next[part(1u) + a] = vec4(rest - steps * shape.quantum, 0.0);
}
