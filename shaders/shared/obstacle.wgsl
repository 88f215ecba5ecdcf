//! What a patch feels of an obstacle: the law of planes, with the obstacle's signed distance as the gap. Twin of
//! palpate-cpu/src/terms/obstacles.rs.
// use shared/moving
// use shared/contact
// use shared/distance
// use shared/patch_way

// A gap in the world, with its derivatives by place and, at a fixed place, by time.
struct Gap {
    value: f32,
    normal: vec3<f32>,
    hessian: mat3x3<f32>,
    rate: f32,
    turning: vec3<f32>,
}

// Sums over the instants of a step, for a stiffness of 1 Pa/m and an area of 1 m²: pressure, its derivatives by the new and the old gap, energy.
struct Touch {
    felt: bool,
    pressure: f32,
    by_fresh: f32,
    by_past: f32,
    energy: f32,
    fresh: Gap,
    past: Gap,
}

// `away` is the place from the obstacle's origin.
fn gap_to(o: Obstacle, pose: MovingPose, away: vec3<f32>) -> Gap {
    let d = distance_at(o, transpose(pose.turn) * away);
    let coming = transpose(pose.turn_rate) * away - transpose(pose.turn) * pose.shift_rate.xyz;
    return Gap(
        d.value,
        pose.turn * d.gradient,
        pose.turn * d.hessian * transpose(pose.turn),
        dot(d.gradient, coming),
        pose.turn_rate * d.gradient + pose.turn * (d.hessian * coming),
    );
}

// Of a patch at `site` at rest, whose displacements `way` has.
fn touch_obstacle(number: u32, member: u32, site: vec3<f32>, way: PatchWay, theta: f32) -> Touch {
    let o = obstacles[number];
    let pose = moving_pose(member, 0u, number);
    let width = shape.contact_width;
    var t: Touch;
    t.fresh = gap_to(o, pose, ((site - pose.shift.xyz) + way.whole) + way.rest);
    t.past = t.fresh;
    if acts_along(theta) {
        let before = moving_pose(member, 1u, number);
        t.past = gap_to(o, before, ((site - before.shift.xyz) + way.old_whole) + way.old_rest);
    }
    if min(t.fresh.value, t.past.value) >= width {
        return t;
    }
    for (var i = 0u; i < instant_count; i++) {
        let at = instant(i, theta);
        if at.x == 0.0 {
            break;
        }
        let law = contact_law(t.fresh.value + (1.0 - at.y) * (t.past.value - t.fresh.value), width);
        t.pressure += at.x * law.pressure;
        t.by_fresh += at.x * at.y * law.slope;
        t.by_past += at.x * (1.0 - at.y) * law.slope;
        t.energy += at.x / at.y * law.energy;
    }
    t.felt = t.energy > 0.0;
    return t;
}

// Change of the force over −stiffness · area, for changes of the new and old gap and of the new normal.
fn change_of(t: Touch, by: vec2<f32>, normal: vec3<f32>) -> vec3<f32> {
    return (t.by_fresh * by.x + t.by_past * by.y) * t.fresh.normal + t.pressure * normal;
}

// That for a shift of the obstacle, and that for a later time.
fn shifted(t: Touch, d: vec3<f32>) -> vec3<f32> {
    return change_of(t, -vec2(dot(t.fresh.normal, d), dot(t.past.normal, d)), -(t.fresh.hessian * d));
}

fn later(t: Touch) -> vec3<f32> {
    return change_of(t, vec2(t.fresh.rate, t.past.rate), t.fresh.turning);
}
