r"""The compiled landing: a tube with sliding slices on a rigid table, with every impact at its own time.

      corner 2 +------+ corner 3     corners c at (a_c, b_c) from the tube's middle, a along u_r, b along u_t:
               |      |                0: (L/2, R)   1: (L/2, -R)   base;   2: (-L/2, R)   3: (-L/2, -R)   cap
               |  o   | s_i            u_r = (sin theta, -cos theta),  u_t = (cos theta, sin theta)
               |  v   |              slice i at s_i u_r from the middle, s_i' = w_i relative to the tube
      corner 1 +------+ corner 0
          ====================  y = 0

Write V = v_r u_r + v_t u_t for the velocity of the middle, F and T for force and torque of the table about it, p_i for
the push of what a slice touches. Newton's law for each slice along u_r, for the tube along u_r, and for all together
across the axis and in rotation, in terms of A = dV/dt - g:

    A_r + w_i'                = omega^2 s_i - (alpha/m) w_i + p_i/m
    M_b A_r                   = F_r + sum (alpha w_i - p_i)                             (pushes between slices cancel)
    M A_t + m S_1 omega'      = F_t - 2 m omega sum w_i              S_1 = sum s_i,  S_2 = sum s_i^2
    m S_1 A_t + (J_b + m S_2) omega' = T - 2 m omega sum s_i w_i     J_b = M_b (R^2/2 + L^2/12)

A step is the midpoint rule: places by half a step, velocities with the forces there, places by the other half.
Contacts that are closed act in it by impulses that keep them closed at its end or let them open. Gaps that are open
and would be negative at its end cut the step short at the first of them, where the impact happens; a rebound that
would return within one step is a rest: its gap is closed.

Impulses on the slices of one axial chain have a closed form. With z = v+ + e v- Newton's law, w+ + e w- >= 0, p >= 0,
product 0 on every touching gap, says that z is the point nearest to (1 + e) v- (in the metric of the masses) at which
no gap has z_gap < 0: a monotone regression, found by pooling neighbours that approach. In a step e = 0. The impulses
of the table, Coulomb's cone included, are those of one corner in closed form, swept over the corners with the mass
that is pooled with the tube, until the pool no longer changes.

layout    what a landing is given and returns       contacts  gaps, their rates, and what rests on what
pools     impulses along the axis                   impulses  Coulomb's cone, and all impulses of one instant
motion    a step, an impact, the energy             loop      from instant to instant until the outcome is certain

Only ``pools``, ``contacts`` and what imports them load numba.
"""
