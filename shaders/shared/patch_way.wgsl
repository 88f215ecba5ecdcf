//! The way of a surface patch's mean point in a step.
// use shared/patches

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;

// Place or displacement in the new and in the old state, each in two parts.
struct PatchWay {
    whole: vec3<f32>,
    rest: vec3<f32>,
    old_whole: vec3<f32>,
    old_rest: vec3<f32>,
}

// Displacements are added to `start`; the old state is the new one where it is not asked for.
fn patch_way(member: u32, patch_number: u32, start: vec3<f32>, reads_old: bool) -> PatchWay {
    let stencil = patch_stencil(patch_number);
    var way = PatchWay(start, vec3(0.0), start, vec3(0.0));
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        let a = at_node(member, stencil_entries[k].node);
        let w = stencil_entries[k].weight;
        way.whole += w * next[a].xyz;
        way.rest += w * next[part(1u) + a].xyz;
        if reads_old {
            way.old_whole += w * now[a].xyz;
            way.old_rest += w * now[part(1u) + a].xyz;
        }
    }
    if !reads_old {
        way.old_whole = way.whole;
        way.old_rest = way.rest;
    }
    return way;
}
