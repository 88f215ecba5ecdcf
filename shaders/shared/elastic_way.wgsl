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
}

fn elastic_way(member: u32, point: u32, m: Member, mix: Mix) -> Way {
    let h = gradient_next(member, point);
    let fresh = respond_at(h, mat3x3<f32>(), m.lame.xy, m.lame.zw);
    var w: Way;
    w.viscous = viscous(member, point, h, m.lame.xy);
    w.stress = fresh.stress * mix.fresh + w.viscous * mix.rate;
    w.by_poisson = fresh.change * mix.fresh + viscous(member, point, h, m.lame.zw) * mix.rate;
    if mix.old != 0.0 {
        let old = respond_at(gradient_now(member, point), mat3x3<f32>(), m.lame.xy, m.lame.zw);
        w.stress += old.stress * mix.old;
        w.by_poisson += old.change * mix.old;
    }
    return w;
}
