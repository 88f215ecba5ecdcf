//! Laws of cells: scalars of a cell's deformation, what laws say of them, and the body-frame forces that follow. Twin of
//! palpate-cpu/src/terms/elastic_cells/laws.rs. All laws of a plan act at once, and the material where it is not linear, as one more; and its
//! viscosity.
// use shared/laws
// use shared/past
// use materials/all
// use shared/flow

// Gradient weights of the corners in the mean strain of what deforms in a cell of each class.
var<body> mean_gradients: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;

// The change of the input that derivatives are taken along.
var<private> along: array<f32, CELL_INPUTS>;

struct Answer {
    value: f32,
    // By the scalars.
    first: array<f32, SCALARS>,
    // Change of that along a change of the input.
    bend: array<f32, SCALARS>,
}

// Scalars that the energies of this plan's laws depend on.
fn scalars() -> u32 {
    return (shape.fields >> SCALARS_AT) & MOST_SCALARS;
}

// Number of the plan's material, 0 where it is linear.
fn material() -> u32 {
    return (shape.fields >> MATERIAL_AT) & MOST_MATERIALS;
}

// Asks the law of a number, with the input's values and `along` in place, for derivatives by the first `count` scalars.
fn ask_law(law: u32, which: u32, count: u32) -> Answer {
    var r: Answer;
    for (var i = 0u; i < SCALARS; i++) {
        if i >= count {
            break;
        }
        for (var k = 0u; k < CELL_INPUTS; k++) {
            input[k] = vec4(input[k].x, f32(k == i), along[k], 0.0);
        }
        let v = cell_law(law, which);
        r.value = v.x;
        r.first[i] = v.y;
        r.bend[i] = v.w;
    }
    return r;
}

// Puts the input of a law in place: scalars `s` that change by `ds`, and its numbers, which do not.
fn fill(c: Corner, effect: EffectSite, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) {
    var values = s;
    var changes = ds;
    step_rate = 1.0 / shape.dt;
    for (var i = 0u; i < CELL_INPUTS; i++) {
        if i < SCALARS {
            input[i] = number(values[min(i, SCALARS - 1u)]);
            along[i] = changes[min(i, SCALARS - 1u)];
        } else {
            let p = i - SCALARS;
            input[i] = number(0.0);
            if p < effect.count {
                input[i] = number(effect_values[c.member * effect.stride + effect.first + p]);
            }
            along[i] = 0.0;
        }
    }
}

fn add_answer(sum: ptr<function, Answer>, answer: Answer) {
    var r = answer;
    (*sum).value += r.value;
    for (var i = 0u; i < SCALARS; i++) {
        (*sum).first[i] += r.first[i];
        (*sum).bend[i] += r.bend[i];
    }
}

// Sum over the plan's laws at scalars `s` that change by `ds`.
fn ask(c: Corner, which: u32, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> Answer {
    var sum: Answer;
    // Dissipation is a function of the increment; what it takes from the old state is not differentiated.
    let count = select(scalars(), 1u, which == LOSS_PART);
    for (var k = 0u; k < MOST_LAWS; k++) {
        if k >= law_count() {
            break;
        }
        let effect = cell_effects[k];
        fill(c, effect, s, ds);
        add_answer(&sum, ask_law(effect.law, which, count));
    }
    return sum;
}

// What the plan's material has beyond the linear one at the mean strain in `input`, for E = 1; numbers of changes are those of `input`.
fn material_beyond(lambda: Dual, mu: Dual) -> Dual {
    let h = Gradient(
        Three(strain(0u), strain(5u), strain(4u)),
        Three(strain(5u), strain(1u), strain(3u)),
        Three(strain(4u), strain(3u), strain(2u)),
    );
    return material_energy(material(), h, lambda, mu) - linear_energy(h, lambda, mu);
}

// Puts the mean strain of scalars `s` in place: ε₁ stands for `first`, ε₂ for `second`.
fn strain_input(s: array<f32, SCALARS>, first: array<f32, SCALARS>, second: array<f32, SCALARS>) {
    var values = s;
    var a = first;
    var b = second;
    for (var i = 0u; i < SCALARS; i++) {
        input[i] = vec4(values[i], a[i], b[i], 0.0);
    }
}

// A unit vector.
fn along_scalar(k: u32) -> array<f32, SCALARS> {
    var one = nowhere();
    one[min(k, SCALARS - 1u)] = f32(k < SCALARS);
    return one;
}

// The plan's material at scalars `s` that change by `ds`, and Poisson's ratio by `poisson`: each lane of the cell differentiates by the scalar
// of its number.
fn ask_material(c: Corner, s: array<f32, SCALARS>, ds: array<f32, SCALARS>, poisson: f32) -> Answer {
    strain_input(s, along_scalar(c.number), ds);
    let lame = c.m.lame;
    let v = material_beyond(vec4(lame.x, 0.0, poisson * lame.z, 0.0), vec4(lame.y, 0.0, poisson * lame.w, 0.0));
    var r: Answer;
    r.value = v.x;
    publish(vec3(v.y, v.w, 0.0));
    for (var i = 0u; i < SCALARS; i++) {
        let of_lane = published(i);
        r.first[i] = of_lane.x;
        r.bend[i] = of_lane.y;
    }
    return r;
}

// Energy of laws and material.
fn ask_energy(c: Corner, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> Answer {
    var sum = ask(c, ENERGY_PART, s, ds);
    if material() != 0u {
        add_answer(&sum, ask_material(c, s, ds, 0.0));
    }
    return sum;
}

// One state of a cell: pose, this lane's deformation and K q, and the scalars.
struct Side {
    pose: Pose,
    q: vec3<f32>,
    kq: vec3<f32>,
    s: array<f32, SCALARS>,
}

fn volume_of(c: Corner) -> f32 {
    return cells[c.cell].fraction * shape.h * shape.h * shape.h;
}

fn stiffness_of(c: Corner) -> u32 {
    return matrix_at(c.m.slot, 0u, cells[c.cell].kind);
}

// The weight of this corner.
fn mean_gradient(c: Corner) -> vec3<f32> {
    return mean_gradients[8u * cells[c.cell].kind + c.number].xyz;
}

// Mean strain of a deformation, in places 1 to 6.
fn strains(c: Corner, q: vec3<f32>) -> array<f32, SCALARS> {
    let g = mean_gradient(c);
    let h = mat3x3(sum8(q * g.x), sum8(q * g.y), sum8(q * g.z));
    return array<f32, SCALARS>(0.0, h[0].x, h[1].y, h[2].z, 0.5 * (h[1].z + h[2].y), 0.5 * (h[2].x + h[0].z), 0.5 * (h[0].y + h[1].x));
}

// (a·b summed over the corners)/V.
fn mean(c: Corner, a: vec3<f32>, b: vec3<f32>) -> f32 {
    return sum8(vec3(dot(a, b), 0.0, 0.0)).x / volume_of(c);
}

fn side_at(c: Corner, pose: Pose, q: vec3<f32>) -> Side {
    var s: Side;
    s.pose = pose;
    s.q = q;
    s.kq = stiff(stiffness_of(c), c.number, s.q);
    s.s = strains(c, s.q);
    s.s[0] = max(0.5 * mean(c, s.q, s.kq), 0.0);
    return s;
}

fn new_side(c: Corner) -> Side {
    let pose = pose_of((next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz), c.sign);
    return side_at(c, pose, from_rest(pose.q, c.at));
}

fn old_side(c: Corner) -> Side {
    let pose = pose_of((now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz), c.sign);
    return side_at(c, pose, past_q(c, pose.q));
}

// Σ V ∇s_k c_k at this corner: the body-frame force for E = 1 that goes with coefficients c.
fn stress(c: Corner, side: Side, k: array<f32, SCALARS>) -> vec3<f32> {
    let sym = mat3x3(
        vec3(k[1], 0.5 * k[6], 0.5 * k[5]),
        vec3(0.5 * k[6], k[2], 0.5 * k[4]),
        vec3(0.5 * k[5], 0.5 * k[4], k[3]),
    );
    return k[0] * side.kq + volume_of(c) * (sym * mean_gradient(c));
}

// Change of the scalars with a change of q.
fn scalar_rates(c: Corner, side: Side, dq: vec3<f32>) -> array<f32, SCALARS> {
    var ds = strains(c, dq);
    ds[0] = mean(c, side.kq, dq);
    return ds;
}

// The increment of a step: K (q₁ − q₀) at this corner, and d.
struct Way {
    kd: vec3<f32>,
    d: f32,
}

fn way_of(c: Corner, fresh: Side, old: Side) -> Way {
    var w: Way;
    let dq = fresh.q - old.q;
    w.kd = stiff(stiffness_of(c), c.number, dq);
    w.d = max(0.5 * mean(c, dq, w.kd), 0.0);
    return w;
}

// φ with its first derivative by d, and the change of that along changes of d and a₀; nothing in a static problem.
fn loss_of(c: Corner, w: Way, old: Side, change: vec2<f32>) -> vec3<f32> {
    if call.mode == 0u {
        return vec3(0.0);
    }
    var s: array<f32, SCALARS>;
    var ds: array<f32, SCALARS>;
    s[0] = w.d;
    s[1] = old.s[0];
    ds[0] = change.x;
    ds[1] = change.y;
    let r = ask(c, LOSS_PART, s, ds);
    return vec3(r.value, r.first[0], r.bend[0]);
}

fn nowhere() -> array<f32, SCALARS> {
    return array<f32, SCALARS>();
}

// The way of a cell from the past as the material's viscosity sees it: K₀ (q₁ − q̃) at this corner, with K₀ the matrix for E = 1 and ν = 0, whose
// energy is ½|ε|²; φ with its first and second derivative by d = ½ (q₁ − q̃)·K₀ (q₁ − q̃)/V; and |ΔE|² = 2d.
struct FlowWay {
    kd: vec3<f32>,
    by: vec3<f32>,
    squared: f32,
}

fn flow_matrix(c: Corner) -> u32 {
    return matrix_at(u32(c.m.flow.z), 0u, cells[c.cell].kind);
}

fn flow_way(c: Corner, fresh: Side, old: Side) -> FlowWay {
    var w: FlowWay;
    let dq = fresh.q - old.q;
    w.kd = stiff(flow_matrix(c), c.number, dq);
    w.squared = max(mean(c, dq, w.kd), 0.0);
    w.by = flow_loss(c.m, w.squared) * vec3(1.0, 2.0, 4.0);
    return w;
}

// Change of its body-frame force with a change of the past's deformation; symmetric.
fn flow_by_old(c: Corner, w: FlowWay, dq: vec3<f32>) -> vec3<f32> {
    return -w.by.y * stiff(flow_matrix(c), c.number, dq) - (w.by.z * mean(c, w.kd, dq)) * w.kd;
}
