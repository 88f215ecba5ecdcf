//! The whole stress of an elastic point in a solve, over Young's modulus, and its derivative by Poisson's ratio.
// use shared/elastic
// use shared/viscous

struct Way {
    // Elastic and viscous, the old state's share included.
    stress: mat3x3<f32>,
    // By Poisson's ratio.
    by_poisson: mat3x3<f32>,
    // The viscous part for a damping of one over the length of the solve.
    viscous: mat3x3<f32>,
    // The material's viscosity, by its coefficient and exponent; no modulus scales it.
    by_coefficient: mat3x3<f32>,
    by_exponent: mat3x3<f32>,
}

fn elastic_way(member: u32, point: u32, m: Member, mix: Mix) -> Way {
    let h = gradient_next(member, point);
    let lame = lame_at(m, point);
    let fresh = respond_at(h, mat3x3<f32>(), lame.xy, lame.zw);
    var w: Way;
    w.viscous = viscous(member, point, h, lame.xy);
    w.stress = fresh.stress * mix.fresh + w.viscous * mix.rate;
    w.by_poisson = fresh.change * mix.fresh + viscous(member, point, h, lame.zw) * mix.rate;
    if call.mode != 0u && !has_mean(point) {
        let g = strained(member, point, h);
        let by = flow_by_numbers(m, contract(g, g));
        let flowing = (identity3() + h) * g * 2.0;
        w.by_coefficient = flowing * by.x;
        w.by_exponent = flowing * by.y;
    }
    if mix.old != 0.0 {
        let old = respond_at(gradient_now(member, point), mat3x3<f32>(), lame.xy, lame.zw);
        w.stress += old.stress * mix.old;
        w.by_poisson += old.change * mix.old;
    }
    return w;
}
