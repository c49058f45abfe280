% Solves the systems of a folder as Octave does, and says how: called by octave.py.
%   argv: the folder with *.mat (A sparse, name), the file for the results, how often each is solved
arguments = argv();
files = glob([arguments{1} "/*.mat"]);
out = fopen(arguments{2}, "w");
for k = 1:numel(files)
  data = load(files{k});
  A = data.A;
  n = rows(A);
  x_true = 1 + mod((1:n)', 5);
  b = A * x_true;
  best = Inf;
  for r = 1:str2double(arguments{3})
    lastwarn("", "");
    t = tic;
    x = A \ b;
    best = min(best, toc(t));
  end
  [text, id] = lastwarn();
  error_of_x = norm(A * x - b, Inf) / (norm(A, Inf) * norm(x, Inf) + norm(b, Inf));
  fprintf(out, "%s %d %.6e %.3e %.3e %s|%s\n", data.name, n, best, error_of_x, norm(x - x_true, Inf) / 5, id, text);
end
fclose(out);
