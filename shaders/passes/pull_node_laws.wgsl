//! Derivatives by what an effect on nodes depends on. call.extra: the effect, what is sought of it, and its first row of sums.
// use effects/nodes
// use shared/pull_point

var<body> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_node_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let effect = effects[asked_effect()];
    let m = members[p.member];
    let a = at_node(p.member, p.item);
    let v = part(2u) + a;
    prepare(effect, p.member, m, mix_of(m));
    place_point(rest[p.item].xyz, next[a].xyz, next[part(1u) + a].xyz, now[a].xyz, now[part(1u) + a].xyz, now[v].xyz);
    let rows = p.member * effect.rows;
    measure = number(effect_measures[(rows + effect.measures) * shape.nodes + p.item]);
    aim(probe[a].xyz);
    // The potential is proportional to the share, which may depend on the numbers as well.
    var beside = Beside(NONE, 0.0, vec3(0.0), vec3(0.0));
    if effect.slopes != NONE {
        beside.measures = (rows + effect.slopes) * shape.nodes + p.item;
    }
    take_inputs(effect, beside, 0u, p.member, p.item);
}
