//! What an effect does to every node, added to what the balance's own passes left there. call.extra: the effect and the
//! question (shared/points.wgsl).
//! `forces` is the residual (with the energy), the right-hand side of a tangent, the adjoint of the old state or a column.
// use effects/nodes

// [B][rows][N]: volumes of the nodes, or their shares of the effect's load, and the shares' derivatives.
var<batch> effect_measures: array<f32>;
var<body> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read> newton: array<Newton>;
var<body> diagonals: array<u32>;
// A residual is as gather_residual has it.
var<storage, read_write> forces: array<vec4<f32>>;
var<storage, read_write> values: array<f32>;

@compute @workgroup_size(64)
fn press_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let effect = effects[asked_effect()];
    let what = asked_question();
    let m = members[p.member];
    let a = at_node(p.member, p.item);
    let v = part(2u) + a;
    prepare(effect, p.member, m, mix_of(m));
    place_point(rest[p.item].xyz, next[a].xyz, next[part(1u) + a].xyz, now[a].xyz, now[part(1u) + a].xyz, now[v].xyz);
    let row = (p.member * effect.rows + effect.measures) * shape.nodes + p.item;
    measure = vec4(effect_measures[row], 0.0, 0.0, 0.0);
    var weight = vec3(0.0);
    if what == BY_OLD {
        for (var i = 0u; i < 3u; i++) {
            change[OLD_AT + i] = probe[a][i];
            change[VELOCITY_AT + i] = probe[part(1u) + a][i];
        }
    }
    if what == BACK {
        weight = probe[a].xyz;
    }
    if what == COLUMN {
        change_along(effect, p.member);
        if effect.slopes != NONE {
            for (var i = 0u; i < effect.count; i++) {
                let slope = effect_measures[(p.member * effect.rows + effect.slopes + i) * shape.nodes + p.item];
                measure.z += slope * change[COMMON + i];
            }
        }
    }
    let r = respond(effect.law, what, weight);
    switch what {
        case FORCE: {
            forces[a] += r.a;
            forces[part(1u) + a].w += abs(r.a.w);
            forces[part(2u) + a] += vec4(r.a.xyz, 0.0);
        }
        case STIFFNESS: {
            if newton[p.member].convex == 0u || positive(r) {
                let at = (p.member * shape.blocks + diagonals[p.item]) * 9u;
                let rows = mat3x3(vec3(r.b.x, r.c.x, r.c.y), vec3(r.c.x, r.b.y, r.c.z), vec3(r.c.y, r.c.z, r.b.z));
                for (var i = 0u; i < 3u; i++) {
                    for (var j = 0u; j < 3u; j++) {
                        values[at + 3u * i + j] += rows[i][j];
                    }
                }
            }
        }
        case BACK: {
            forces[a] -= vec4(r.a.xyz, 0.0);
            forces[part(1u) + a] -= vec4(r.b.xyz, 0.0);
        }
        case BY_OLD: { forces[a] -= vec4(r.a.xyz, 0.0); }
        default: { forces[a] += vec4(r.a.xyz, 0.0); }
    }
}
