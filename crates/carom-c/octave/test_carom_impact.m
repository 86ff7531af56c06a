% The first tutorial in Octave: the numbers of the command line to the last digit.
%   octave-cli --eval "test_carom_impact('ROBOTS', 'ANSWER.json')": ANSWER.json is the answer of `carom impact --json`.
function test_carom_impact(robots, answer)
  urdf = fullfile(robots, 'planar2.urdf');
  told = jsondecode(fileread(answer));
  q = [0.7854; -1.5708];
  qd = [-0.15; 0.6];
  hit = carom_impact(urdf, 'tip', [-1 0 0], 'energetic', [0.35 0.2], q, qd);
  for name = {'qd_plus', 'impulse', 'u_minus', 'u_plus', 'energy_before', 'energy_after', 'normal_work', 'friction_work'}
    own = hit.(name{1});
    expected = told.(name{1});
    assert(isequal(own(:), expected(:)), sprintf('%s: %s, the command line: %s', name{1}, mat2str(own, 17), mat2str(expected, 17)));
  end
  assert(strcmp(hit.mode{1}, told.mode));
  assert(hit.flags == 0);

  % The columns of a batch are states: a row vector is one state, too.
  many = carom_impact(urdf, 'tip', [-1 0 0], 'energetic', [0.35 0.2], [q q], [qd 2*qd]);
  assert(isequal(many.qd_plus(:, 1), hit.qd_plus) && size(many.impulse, 2) == 2);
  assert(max(abs(many.qd_plus(:, 2) - 2 * hit.qd_plus)) < 1e-15);
  row = carom_impact(urdf, 'tip', [-1 0 0], 'energetic', [0.35 0.2], q', qd', [0 0 0]);
  assert(isequal(row.qd_plus, hit.qd_plus));

  % Refusals are errors of Octave with the message of the library; the interpreter goes on.
  refused('no link is named ''tipp''', @() carom_impact(urdf, 'tipp', [-1 0 0], 'energetic', [0.35 0.2], q, qd));
  refused('q has 3 numbers, 2 are needed', @() carom_impact(urdf, 'tip', [-1 0 0], 'energetic', [0.35 0.2], [q; 0], qd));
  refused('no joint moves ''tip''', @() carom_impact(urdf, 'tip', [-1 0 0], 'energetic', [0.35 0.2], [0; 0], qd));
  refused('normal: give three real numbers', @() carom_impact(urdf, 'tip', [-1 0], 'energetic', [0.35 0.2], q, qd));
  refused('needs urdf, frame', @() carom_impact(urdf));
  printf('octave %s: the first tutorial to the last digit\n', version());
end

function refused(part, call)
  try
    call();
  catch why
    assert(~isempty(strfind(why.message, part)), why.message);
    return;
  end
  error('not refused: %s', part);
end
