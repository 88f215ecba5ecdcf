//! Eight invocations that share an item: their sum and their least, in a fixed order. A kernel calls one of the two once, with all invocations.

var<workgroup> eighths: array<vec4<f32>, 64>;

fn sum_of_eight(local: u32, v: vec4<f32>) -> vec4<f32> {
    eighths[local] = v;
    workgroupBarrier();
    let b = local & ~7u;
    let low = (eighths[b] + eighths[b + 1u]) + (eighths[b + 2u] + eighths[b + 3u]);
    let high = (eighths[b + 4u] + eighths[b + 5u]) + (eighths[b + 6u] + eighths[b + 7u]);
    return low + high;
}

fn least_of_eight(local: u32, v: f32) -> f32 {
    eighths[local] = vec4(v);
    workgroupBarrier();
    let b = local & ~7u;
    let low = min(min(eighths[b].x, eighths[b + 1u].x), min(eighths[b + 2u].x, eighths[b + 3u].x));
    let high = min(min(eighths[b + 4u].x, eighths[b + 5u].x), min(eighths[b + 6u].x, eighths[b + 7u].x));
    return min(low, high);
}
