//! Derivatives by what an effect on nodes depends on. call.extra: the effect, what is sought of it, and its first row of sums.
// use shared/pull_point

// As press_nodes has them.
var<storage, read> effect_measures: array<f32>;
var<storage, read> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_node_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    let effect = effects[asked_effect()];
    if p.live {
        let m = members[p.member];
        let a = at_node(p.member, p.item);
        let v = part(2u) + a;
        prepare(effect, p.member, m, mix_of(m));
        place_point(rest[p.item].xyz, next[a].xyz, next[part(1u) + a].xyz, now[a].xyz, now[part(1u) + a].xyz, now[v].xyz);
        let row = (p.member * effect.rows + effect.measures) * shape.nodes + p.item;
        measure = number(effect_measures[row]);
        aim(probe[a].xyz);
        add_inputs(effect, 0.0);
        if is_sought(SEEK_OWN) && effect.slopes != NONE {
            // The potential is proportional to the share, which depends on the numbers as well.
            for (var i = 0u; i < MOST; i++) {
                if i < effect.count {
                    let slopes = (p.member * effect.rows + effect.slopes + i) * shape.nodes + p.item;
                    measure = vec4(effect_measures[row], 0.0, effect_measures[slopes], 0.0);
                    by_input[i] += potential(effect.law).w;
                }
            }
        }
    }
    take_inputs(local, effect, p.live, p.member, p.item / 64u);
}
