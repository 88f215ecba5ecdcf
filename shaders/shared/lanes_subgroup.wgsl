//! Eight lanes of a cell talk through subgroup shuffles. The order of every sum is that of `lanes_memory`: same bits.
//! Every invocation of a workgroup must call these functions together.

var<private> offered: vec3<f32>;
var<private> own_lane: u32;
var<private> own_base: u32;

fn lanes_start(local: u32) {
    own_lane = local;
    own_base = subgroupExclusiveAdd(1u) & ~7u;
}

fn publish(v: vec3<f32>) {
    offered = v;
}

fn published(lane: u32) -> vec3<f32> {
    return subgroupShuffle(offered, own_base + lane);
}

fn sum8(v: vec3<f32>) -> vec3<f32> {
    var s = v;
    s += subgroupShuffleXor(s, 1u);
    s += subgroupShuffleXor(s, 2u);
    s += subgroupShuffleXor(s, 4u);
    return s;
}
