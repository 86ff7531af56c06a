% carom_impact  Impacts of a robot from its URDF, for GNU Octave and MATLAB.
%
%   hit = carom_impact(urdf, frame, normal, law, coefficients, q, qd)
%   hit = carom_impact(urdf, frame, normal, law, coefficients, q, qd, point)
%
%   urdf          path of a URDF file
%   frame         name of the link that is struck
%   normal        contact normal, world axes, from the environment to the robot
%   law           'frictionless', 'whittaker', 'newton', 'poisson', 'energetic', 'chatterjee-ruina', 'brach' or 'smith'
%   coefficients  [restitution friction], [restitution friction tangential], or restitution alone
%   q, qd         configuration and joint velocities (rad, m, rad/s, m/s): vectors, or a column for each state
%   point         contact point in the axes of the link, m; its origin by default
%
% hit has the fields qd_plus (nv x states), impulse (N s), u_minus and u_plus (m/s), each 3 x states and in world axes;
% energy_before, energy_after, normal_work and friction_work (J), flags (bits: carom.h) and mode (a cell of words).
% States without a solution are NaN, with a warning; a single one is an error.
%
% This file is the help; the program is the MEX file of the same name (carom_impact.c).
error('carom:build', 'build the MEX file first: mkoctfile --mex carom_impact.c -lcarom_c, with -I and -L of the installed package');
