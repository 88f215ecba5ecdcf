//! All laws of cells at once at an element's strains: θψ + φ with its derivatives by the components of a strain, and the change of these.
// use effects/tets
// A pass says how numbers of laws change: `number_along`.

struct Question {
    strain: mat3x3<f32>,
    past: mat3x3<f32>,
    // Changes of both, and of Poisson's ratio.
    dstrain: mat3x3<f32>,
    dpast: mat3x3<f32>,
    poisson: f32,
    // Weight of ψ, and whether φ counts.
    weight: f32,
    lossy: bool,
    // Derivatives are by ε̃ instead of ε₁.
    by_past: bool,
    // Of φ's curvature by d only what is not negative counts.
    majorised: bool,
}

// What a force asks at the old state, which loses nothing, or at the new one.
fn question_of(member: u32, element: u32, mix: Mix, a: Stretch, old: bool) -> Question {
    var q: Question;
    q.strain = a.strain;
    q.weight = select(mix.fresh, mix.old, old);
    if !old && call.mode != 0u {
        q.past = past_stretch(member, element);
        q.lossy = true;
    }
    return q;
}

// The change of a dissipation's derivative without negative curvature by d: d in `input` is taken as if it were bilinear in both changes, and what that
// alters has the sign of φ's second derivative times those of d's.
fn majorised_change(law: u32, change: f32) -> f32 {
    let both = input[0].y * input[0].z;
    input[0].z = 0.0;
    let without = cell_law(law, LOSS_PART).w;
    return select(change, without, (change - without) * both < 0.0);
}

fn ask_laws(m: Member, member: u32, q: Question) -> Said {
    var said: Said;
    step_rate = 1.0 / shape.dt;
    for (var part = 0u; part < 2u; part++) {
        let loses = part == LOSS_PART;
        if (loses && !q.lossy) || (!loses && q.weight == 0.0) {
            continue;
        }
        let weight = select(q.weight, 1.0, loses);
        var asked: Asked;
        asked.x = q.strain - q.past * f32(loses);
        asked.past = q.past;
        asked.second = q.dstrain - q.dpast * f32(loses);
        asked.second_past = q.dpast;
        asked.lame = m.lame.xy;
        asked.dlame = m.lame.zw * q.poisson;
        for (var k = 0u; k < MOST_LAWS; k++) {
            if k >= law_count() {
                break;
            }
            let effect = cell_effects[k];
            for (var i = SCALARS; i < CELL_INPUTS; i++) {
                input[i] = number(0.0);
                if i - SCALARS < effect.count {
                    let value = effect_values[member * effect.stride + effect.first + i - SCALARS];
                    input[i] = vec4(value, 0.0, number_along(member, effect, i - SCALARS), 0.0);
                }
            }
            for (var c = 0u; c < 6u; c++) {
                let unit = unit_strain(c);
                asked.first = unit * select(1.0, -1.0, q.by_past);
                asked.first_past = unit * f32(q.by_past);
                put_scalars(part, asked);
                var v = cell_law(effect.law, part);
                if loses && q.majorised {
                    v.w = majorised_change(effect.law, v.w);
                }
                v *= weight;
                // Components off the diagonal stand for two entries.
                let half = unit * select(1.0, 0.5, c >= 3u);
                said.value += select(0.0, v.x, c == 0u);
                said.t += half * v.y;
                said.change += half * v.w;
            }
        }
    }
    return said;
}
