% The paper's MATLAB program (Supplementary Text 1) for Octave, as a solver that flipproof asks by files.
%
%   flipproof certify "cmd:octave-cli -q paper.m {scenario} {times} {start} {effort} {out}" --equation published-matlab
%   flipproof certify csv:answers --equation published-matlab --refined-by dt --order 1     (writes the questions)
%   octave-cli -q paper.m answers && flipproof certify csv:answers
%
% The step, the signs, g = 9.8 and the rebound factor -1/2 are as printed. Bottle, water, drag and release are those of
% the throw that is asked for, and only the present step is kept. Slices leave the bottle here, as they do there.

1;  % this file is a script that begins with functions

function r_CM = FindCenterOfMass(r, L, epsilon)
  r_CM = (1 - epsilon)*mean(r) + epsilon*L/2;
end

function J = InertiaMomentum(r, r_CM, M_W, M_b, R, L)
  J = M_W/numel(r)*sum((r - r_CM).^2) + M_b*(R^2/2 + L^2/12 + (L/2 - r_CM)^2);
end

function [r_new, v_new] = FindNewlocation(r, v, r_CM, dt, g, omega, theta, alpha, M_W, N)
  x = r - r_CM + g/omega^2*cos(theta);
  gam = alpha/2/M_W*N;
  fade = exp(-gam*dt);
  r_new = x*fade*cosh(omega*dt) + (v/omega + alpha/2/M_W/N/omega*x)*fade*sinh(omega*dt) ...
    + r_CM - g/omega^2*cos(theta);
  v_new = (x*(omega^2 - gam^2)/omega + gam/omega*v)*fade*sinh(omega*dt) + v*cosh(omega*dt)*fade;
end

function v = CheckBoundaryConditions(r, v, h, N, L)
  hit = r < h/(2*N) | r > L - h/(2*N);
  v(hit) = -0.5*v(hit);
end

function tables = ReadToml(file)  % [table] and key = value, of the simple kind that flipproof writes
  tables = struct();
  for line = strsplit(fileread(file), "\n")
    head = regexp(line{1}, '^\s*\[(\w+)\]', 'tokens');
    pair = regexp(line{1}, '^\s*(\w+)\s*=\s*([^#]+)', 'tokens');
    if !isempty(head)
      table = head{1}{1};
    elseif !isempty(pair)
      tables.(table).(pair{1}{1}) = str2num(pair{1}{2});  % also [0.5, 1.94], true and false
    end
  end
end

function column = ReadColumn(file)
  column = dlmread(file, ",", 1, 0)(:, 1);
end

function Answer(scenario_file, times_file, start_file, effort, out)
  asked = ReadToml(scenario_file);
  bottle = asked.bottle;
  throw = asked.scenario;
  times = ReadColumn(times_file);
  r = ReadColumn(start_file);
  N = numel(r);
  L = bottle.length;
  R = bottle.radius;
  M_b = bottle.mass;
  M_W = throw.water_mass;
  h = M_W/bottle.capacity*L;
  H0 = M_b/(1000*pi*R^2);
  epsilon = H0/(H0 + h);
  g = 9.8;
  v = zeros(N, 1);
  theta = throw.theta0;
  r_CM = FindCenterOfMass(r, L, epsilon);
  J_0 = InertiaMomentum(r, r_CM, M_W, M_b, R, L);
  t = 0;
  rows = zeros(numel(times), 5 + 2*N);
  for k = 1:numel(times)
    steps = ceil((times(k) - t)/effort - 1e-9);
    dt = (times(k) - t)/max(steps, 1);
    for n = 1:steps
      r_CM = FindCenterOfMass(r, L, epsilon);
      omega = J_0*throw.omega0/InertiaMomentum(r, r_CM, M_W, M_b, R, L);
      old = theta;
      theta = theta + dt*omega;
      if !throw.frozen
        [r, v] = FindNewlocation(r, v, r_CM, dt, g, omega, old, throw.drag, M_W, N);
        v = CheckBoundaryConditions(r, v, h, N, L);
      end
    end
    t = times(k);
    r_CM = FindCenterOfMass(r, L, epsilon);
    J = InertiaMomentum(r, r_CM, M_W, M_b, R, L);
    rows(k, :) = [t, theta, J_0*throw.omega0/J, r_CM, J, r.', v.'];
  end
  columns = [{"t", "theta", "omega", "r_cm", "inertia"}, ...
    arrayfun(@(i) sprintf("r_%d", i), 0:N-1, "UniformOutput", false), ...
    arrayfun(@(i) sprintf("v_%d", i), 0:N-1, "UniformOutput", false)];
  file = fopen(out, "w");
  fprintf(file, "%s\n", strjoin(columns, ","));
  fprintf(file, [strjoin(repmat({"%.17g"}, 1, numel(columns)), ",") "\n"], rows.');
  fclose(file);
end

given = argv();
if numel(given) == 5
  Answer(given{1:3}, str2double(given{4}), given{5});
else  % a folder of questions: answer every one that has no answer
  for name = sort({dir(given{1}).name})
    place = fullfile(given{1}, name{1});
    if name{1}(1) != "." && exist(fullfile(place, "effort.txt"), "file") && !exist(fullfile(place, "answer.csv"), "file")
      effort = str2double(fileread(fullfile(place, "effort.txt")));
      Answer(fullfile(place, "scenario.toml"), fullfile(place, "times.csv"), fullfile(place, "start.csv"), effort, ...
        fullfile(place, "answer.csv"));
    end
  end
end
