// The login: a name and a password become a cookie that no script can read.

const [form, wrong] = ["login", "wrong"].map((id) => document.getElementById(id));
const field = (id) => document.getElementById(id);

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = form.querySelector("button");
  button.disabled = true;
  wrong.textContent = "";
  try {
    const answer = await fetch("/login", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ name: field("name").value.trim(), password: field("password").value }),
    });
    if (answer.ok) return location.replace("/");
    const wait = answer.headers.get("retry-after");
    const words = (await answer.text()).trim();
    wrong.textContent = wait ? `${words} (${wait} s)` : words;
    field("password").select();
  } catch {
    wrong.textContent = "the gateway does not answer";
  } finally {
    button.disabled = false;
  }
});
