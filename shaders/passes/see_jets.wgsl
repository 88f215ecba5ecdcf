//! Which patches every nozzle sees, and what all jets together do to a patch: it looks through all others for one that is drawn over it, nearer.
// use shared/jet
// use shared/sight

var<storage, read> jet_sights: array<vec4<f32>>;
var<storage, read> jet_pictures: array<Picture>;
// [jets][B][patches]: 1 where it blows.
var<storage, read_write> jet_seen: array<u32>;
// [B][patches]: the force of all of them [N].
var<storage, read_write> jet_forces: array<vec4<f32>>;

@compute @workgroup_size(64)
fn see_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let f = frame_of(p.member, p.item);
    var force = vec3(0.0);
    for (var k = 0u; k < shape.jets; k++) {
        let blown = blow(meeting(k, p.member, p.item, f));
        let picture = jet_pictures[k * shape.members + p.member];
        let own = jet_sights[jet_at(k, p.member, p.item)];
        var seen = 0u;
        if blown.feels && own.z > 0.0 {
            let here = pixel_of(picture, own.xy);
            var nearest = own.z;
            for (var j = 0u; j < shape.patches; j++) {
                let other = jet_sights[jet_at(k, p.member, j)];
                // Most lie behind or are not drawn.
                if other.z > 0.0 && other.z < nearest {
                    let half = 0.5 * other.w / other.z;
                    let low = pixel_of(picture, other.xy - vec2(half));
                    let high = pixel_of(picture, other.xy + vec2(half));
                    if all(low <= here) && all(here <= high) {
                        nearest = other.z;
                    }
                }
            }
            let facing = -blown.through / length(blown.at.area);
            // Rounding takes the cosine of a patch right across the jet beyond one.
            let cosine = clamp(facing, jet_steepest, 1.0);
            let slope = sqrt(1.0 / (cosine * cosine) - 1.0);
            seen = u32(own.z <= nearest + own.w * (1.0 + 1.5 * slope));
        }
        jet_seen[jet_at(k, p.member, p.item)] = seen;
        if seen == 1u {
            force += blown.at.thrust * blown.unit;
        }
    }
    jet_forces[p.member * shape.patches + p.item] = vec4(force, 0.0);
}
