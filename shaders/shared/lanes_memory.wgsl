//! Eight lanes of a cell talk through workgroup memory, where subgroups are missing. The order of every sum is that of
//! `lanes_subgroup`: same bits. Every invocation of a workgroup must call these functions together.

var<workgroup> offered: array<vec3<f32>, 64>;
var<private> own_lane: u32;
var<private> own_base: u32;

fn lanes_start(local: u32) {
    own_lane = local;
    own_base = local & ~7u;
}

fn publish(v: vec3<f32>) {
    workgroupBarrier();
    offered[own_lane] = v;
    workgroupBarrier();
}

fn published(lane: u32) -> vec3<f32> {
    return offered[own_base + lane];
}

fn sum8(v: vec3<f32>) -> vec3<f32> {
    publish(v);
    let a = (published(0u) + published(1u)) + (published(2u) + published(3u));
    let b = (published(4u) + published(5u)) + (published(6u) + published(7u));
    return a + b;
}
